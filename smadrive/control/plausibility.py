"""Between which temperatures the wire must be, given the heat that went in: the check that no sensor can talk away.

Two heat balances bracket the true one. The coldest wire takes up heat slowly (all capacities multiplied by the
uncertainty, the latent heat spread over `TRANSFORMATION_C`), loses it fast, and cools at once; the hottest does the
opposite:

    coldest: C = u_c (m c + Q / span) while it warms, m c / u_c while it cools;  h A · u_h;  colder surroundings
    hottest: C = m c / u_c while it warms, u_c (m c + Q / span) while it cools;  h A / u_h;  warmer surroundings

The reading must lie between them, each seen through a thermocouple that follows late when that widens the band. A bead
that fell off, a reversed thermocouple, a heater that is not measured: all leave the band. A frozen reading is found out
sooner by a second pair that starts anew at every change of the reading: it stands still while even the coldest wire
has moved on (or even the hottest has cooled).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

from smadrive.thermal import HeatBalance

TRANSFORMATION_C = 20.0
"""Span over which the latent heat is taken up, K."""
SURROUNDINGS_C = 10.0
"""By how much the surroundings may differ from the ambient temperature of the heat balance, K."""
MARGIN_C = 6.0
"""What is added on both sides of the band for noise and quantisation, K."""
FROZEN_MARGIN_C = 3.0
"""The same for a reading that stands still, K."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Factors within which the parameters of a heat balance are known, both ways."""

    capacity: float
    loss: float


NOMINAL = Uncertainty(capacity=3.0, loss=2.0)
"""A data sheet: published specific heats differ by 2.6, convection by draught and clamps."""
IDENTIFIED = Uncertainty(capacity=1.5, loss=1.4)
"""A balance identified on this rig, some draught later."""


class Band(NamedTuple):
    """The least and the greatest reading that the heat allows, and the least temperature of the wire itself."""

    low_c: float
    high_c: float
    coldest_c: float


class PlausibleTemperature:
    """The checks above, for a wire whose balance is known within `uncertainty` and whose reading lags by `lag_s`."""

    def __init__(self, balance: HeatBalance, uncertainty: Uncertainty, lag_s: float) -> None:
        self._since_start = _Pair(balance, uncertainty, lag_s)
        self._since_change = _Pair(balance, uncertainty, lag_s)
        self.start(balance.ambient_c)

    def start(self, reading_c: float) -> None:
        """Begin at a wire at rest that reads `reading_c`; it may be warmer or colder than its surroundings."""
        self._since_start.start(reading_c)
        self._since_change.start(reading_c)
        self._reading_c = reading_c

    def update(self, reading_c: float, power_w: float, dt_s: float) -> Band:
        """The band after `dt_s` at `power_w`: that of the reading, or the narrower one if the reading stands still."""
        coldest_c, low_c, high_c = self._since_start.step(power_w, dt_s)
        low_c, high_c = low_c - MARGIN_C, high_c + MARGIN_C
        if reading_c == self._reading_c:
            _, still_low_c, still_high_c = self._since_change.step(power_w, dt_s)
            low_c, high_c = max(low_c, still_low_c - FROZEN_MARGIN_C), min(high_c, still_high_c + FROZEN_MARGIN_C)
        else:
            self._since_change.start(reading_c)
            self._reading_c = reading_c
        return Band(low_c, high_c, coldest_c)


class _Pair:
    """The coldest and the hottest wire, and what a late thermocouple makes of them."""

    def __init__(self, balance: HeatBalance, uncertainty: Uncertainty, lag_s: float) -> None:
        slow = uncertainty.capacity * (balance.heat_capacity_j_per_k + balance.latent_heat_j / TRANSFORMATION_C)
        quick = balance.heat_capacity_j_per_k / uncertainty.capacity
        self._ambient_c = balance.ambient_c
        self._coldest = _Wire(balance.loss_w_per_k * uncertainty.loss, warming_j_per_k=slow, cooling_j_per_k=quick)
        self._hottest = _Wire(balance.loss_w_per_k / uncertainty.loss, warming_j_per_k=quick, cooling_j_per_k=slow)
        self._lag_s = lag_s

    def start(self, reading_c: float) -> None:
        self._coldest.start(reading_c, min(self._ambient_c, reading_c) - SURROUNDINGS_C)
        self._hottest.start(reading_c, max(self._ambient_c, reading_c) + SURROUNDINGS_C)
        self._low_c = self._high_c = reading_c

    def step(self, power_w: float, dt_s: float) -> tuple[float, float, float]:
        """The temperature of the coldest wire, and the least and the greatest reading."""
        coldest_c = self._coldest.step(power_w, dt_s)
        hottest_c = self._hottest.step(power_w, dt_s)
        follow = 1.0 - exp(-dt_s / self._lag_s) if self._lag_s > 0 else 1.0
        self._low_c = min(self._low_c + follow * (coldest_c - self._low_c), coldest_c)
        self._high_c = max(self._high_c + follow * (hottest_c - self._high_c), hottest_c)
        return coldest_c, self._low_c, self._high_c


class _Wire:
    """One of the two wires that bracket the true one."""

    def __init__(self, loss_w_per_k: float, *, warming_j_per_k: float, cooling_j_per_k: float) -> None:
        self._loss_w_per_k = loss_w_per_k
        self._warming_j_per_k = warming_j_per_k
        self._cooling_j_per_k = cooling_j_per_k

    def start(self, temperature_c: float, ambient_c: float) -> None:
        self._temperature_c = temperature_c
        self._ambient_c = ambient_c

    def step(self, power_w: float, dt_s: float) -> float:
        settled_c = self._ambient_c + power_w / self._loss_w_per_k
        capacity = self._warming_j_per_k if settled_c > self._temperature_c else self._cooling_j_per_k
        self._temperature_c = settled_c + (self._temperature_c - settled_c) * exp(-dt_s * self._loss_w_per_k / capacity)
        return self._temperature_c
