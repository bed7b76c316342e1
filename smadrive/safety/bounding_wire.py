"""The coldest and the hottest possible wire of a heat input, each with the thermocouple on it.

With constant power P and heat loss h A, a wire whose heat capacity differs between warming and cooling reaches

    T += (T_e - T) (1 - exp(-dt h A / C)),     T_e = T_a + P / (h A),     C of warming if T_e > T, else of cooling

after dt. T_a is the temperature of its surroundings. Its thermocouple follows with a lag, which is applied only where
this widens the band: the reading of the coldest wire may stay behind a rise of the wire, but not behind a fall.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp
from typing import NamedTuple


class SimpleWire:
    """The temperature of a wire that loses `loss_w_per_k`, with heat capacities on warming and on cooling in J/K."""

    def __init__(self, loss_w_per_k: float, *, warming_j_per_k: float, cooling_j_per_k: float) -> None:
        self._loss_w_per_k = loss_w_per_k
        self.warming_j_per_k = warming_j_per_k
        self._cooling_j_per_k = cooling_j_per_k

    def start(self, temperature_c: float, ambient_c: float) -> None:
        """Put the wire at `temperature_c` into surroundings of `ambient_c`, both in °C."""
        self.temperature_c = temperature_c
        self._ambient_c = ambient_c

    def holding_w(self) -> float:
        """Return the power that holds the temperature, W."""
        return self._loss_w_per_k * (self.temperature_c - self._ambient_c)

    def step(self, power_w: float, dt_s: float) -> float:
        """Heat the wire with `power_w` for `dt_s`. Return its temperature, °C."""
        settled_c = self._ambient_c + power_w / self._loss_w_per_k
        capacity = self.warming_j_per_k if settled_c > self.temperature_c else self._cooling_j_per_k
        decayed_c = (self.temperature_c - settled_c) * exp(-dt_s * self._loss_w_per_k / capacity)
        self.temperature_c = settled_c + decayed_c
        return self.temperature_c


class Shown(NamedTuple):
    """The temperature of a wire, and the reading of the thermocouple on it, both in °C."""

    wire_c: float
    reading_c: float


class BoundingWire(SimpleWire):
    """A wire with its thermocouple. `widest` is min for the coldest possible wire, and max for the hottest."""

    def __init__(
        self,
        loss_w_per_k: float,
        widest: Callable[[float, float], float],
        *,
        warming_j_per_k: float,
        cooling_j_per_k: float,
    ) -> None:
        super().__init__(loss_w_per_k, warming_j_per_k=warming_j_per_k, cooling_j_per_k=cooling_j_per_k)
        self._widest = widest

    @property
    def shown(self) -> Shown:
        """The wire and its reading now."""
        return Shown(self.temperature_c, self.reading_c)

    def start(self, temperature_c: float, ambient_c: float) -> None:
        """Put wire and thermocouple at `temperature_c` into surroundings of `ambient_c`, both in °C."""
        super().start(temperature_c, ambient_c)
        self.reading_c = temperature_c

    def resume(self, shown: Shown) -> None:
        """Go on from an earlier state, in the present surroundings."""
        self.temperature_c, self.reading_c = shown

    def show(self, followed: float) -> None:
        """Let the reading follow the wire by the share `followed` of the difference."""
        self.reading_c = self._widest(
            self.reading_c + followed * (self.temperature_c - self.reading_c), self.temperature_c
        )
