"""A coldest and a hottest possible wire of a heat input, each with the thermocouple on it.

With constant power P and heat loss h A, a wire whose heat capacity differs between warming and cooling reaches

    T += (T_e - T) (1 - exp(-dt h A / C)),     T_e = T_a + P / (h A),     C of warming if T_e > T, else of cooling

after dt. T_a is the temperature of its surroundings. Its thermocouple follows with a lag, which is applied only where
this widens the band: the reading of the coldest wire may stay behind a rise of the wire, but not behind a fall.

A coldest wire has one heat capacity C for warming and cooling. While it warms, it also takes up latent heat, in
proportion to its rise, until it has taken up all of its latent heat Q. While it cools, it gives latent heat back. The
heat that it gave back warms it, and it loses this heat with its time constant C / (h A). Without this heat it is
colder, so the heat does not count; but only what it has lost in this way can be taken up again:

    dQ'/dt = (Q - Q') h A / C     while it cools,     Q' the latent heat that it can take up

So short pulses of current heat a coldest wire as their mean power does. Surroundings that warm a wire without power let
it take up no latent heat: between two runs the room may become warmer.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log
from typing import NamedTuple


class SimpleWire:
    """The temperature of a wire that loses `loss_w_per_k`, with heat capacities on warming and on cooling in J/K."""

    def __init__(self, loss_w_per_k: float, *, warming_j_per_k: float, cooling_j_per_k: float) -> None:
        self._loss_w_per_k = loss_w_per_k
        self._warming_j_per_k = warming_j_per_k
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
        capacity = self._warming_j_per_k if settled_c > self.temperature_c else self._cooling_j_per_k
        decayed_c = (self.temperature_c - settled_c) * exp(-dt_s * self._loss_w_per_k / capacity)
        self.temperature_c = settled_c + decayed_c
        return self.temperature_c


class Shown(NamedTuple):
    """The temperature of a wire, and the reading of the thermocouple on it, both in °C.

    `latent_j` is the latent heat that the wire can take up, J; 0 for a wire whose capacity contains the latent heat.
    """

    wire_c: float
    reading_c: float
    latent_j: float = 0.0


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
        self.temperature_c, self.reading_c, _ = shown

    def show(self, followed: float) -> None:
        """Let the reading follow the wire by the share `followed` of the difference."""
        self.reading_c = self._widest(
            self.reading_c + followed * (self.temperature_c - self.reading_c), self.temperature_c
        )


class ColdestWire(BoundingWire):
    """A wire as cold as possible, with the heat capacity `capacity_j_per_k`.

    `latent_j` is its latent heat, J, of which it takes up `latent_j_per_k` while it warms. `untransformed` is the
    greatest possible share of the wire that has not transformed yet.
    """

    def __init__(self, loss_w_per_k: float, capacity_j_per_k: float, latent_j: float, latent_j_per_k: float) -> None:
        super().__init__(loss_w_per_k, min, warming_j_per_k=capacity_j_per_k, cooling_j_per_k=capacity_j_per_k)
        self._latent_j, self._latent_j_per_k = latent_j, latent_j_per_k
        self.untransformed = 1.0

    @property
    def shown(self) -> Shown:
        """The wire and its reading now."""
        return Shown(self.temperature_c, self.reading_c, self._left_j)

    def start(self, temperature_c: float, ambient_c: float) -> None:
        """Put wire and thermocouple at `temperature_c` into surroundings of `ambient_c`, both in °C."""
        super().start(temperature_c, ambient_c)
        self.untransformed, self._left_j = 1.0, self._latent_j

    def resume(self, shown: Shown) -> None:
        """Go on from an earlier state, in the present surroundings."""
        super().resume(shown)
        self._left_j = shown.latent_j

    def step(self, power_w: float, dt_s: float) -> float:
        """Heat the wire with `power_w` for `dt_s`. Return its temperature, °C."""
        most_j = self.untransformed * self._latent_j
        if power_w <= 0.0 or power_w < self.holding_w():
            self._left_j += (most_j - self._left_j) * (1.0 - exp(-dt_s * self._loss_w_per_k / self._warming_j_per_k))
            return super().step(power_w, dt_s)
        self._left_j = min(self._left_j, most_j)
        return super().step(power_w, dt_s - self._transform(power_w, dt_s))

    def _transform(self, power_w: float, dt_s: float) -> float:
        """Heat the wire until it has taken up all latent heat, or for `dt_s`. Return the time that this took, s."""
        per_k = self.untransformed * self._latent_j_per_k
        if self._left_j <= 0.0:
            return 0.0
        settled_c = self._ambient_c + power_w / self._loss_w_per_k
        end_c, rate = self.temperature_c + self._left_j / per_k, self._loss_w_per_k / (self._warming_j_per_k + per_k)
        most_c = settled_c + (self.temperature_c - settled_c) * exp(-dt_s * rate)
        if most_c <= end_c:
            self._left_j -= (most_c - self.temperature_c) * per_k
            self.temperature_c = most_c
            return dt_s
        took_s = log((settled_c - self.temperature_c) / (settled_c - end_c)) / rate
        self.temperature_c, self._left_j = end_c, 0.0
        return took_s
