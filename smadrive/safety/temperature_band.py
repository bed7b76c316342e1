"""The range of temperatures that the heat input allows: a check that does not rely on the thermocouple.

Two heat balances bracket the true heat balance. The coldest possible wire warms slowly (its heat capacity is multiplied
by the uncertainty, and contains the latent heat spread over `TRANSFORMATION_C`), loses much heat, and cools fast. The
hottest possible wire does the opposite:

    coldest: C = u_c (m c + Q / span) while it warms, m c / u_c while it cools;  h A · u_h;  colder surroundings
    hottest: C = m c / u_c while it warms, u_c (m c + Q / span) while it cools;  h A / u_h;  warmer surroundings

C is the heat capacity that each balance uses. m c, Q and h A are the heat capacity, the latent heat and the heat loss
of the nominal heat balance, u_c and u_h the uncertainties of capacity and loss, and span is `TRANSFORMATION_C`. The
reading must lie between the two temperatures, ± `MARGIN_C`; the lag of the thermocouple is applied to each of them only
where this widens the band. A displacement or resistance that needs a warmer wire raises the temperature of the coldest
wire; a wire of the phase ξ takes up only the share 1 - ξ of Q. The reading leaves the band if the bead falls off, if
the thermocouple is reversed, or if the wire receives heat that is not measured.

A frozen reading, which does not change even in its last digit, is detected sooner, from the power since its last
change:

    C dΔ/dt = P - P₀ - h A Δ,     C and h A of the coldest wire that warms, P the power, P₀ the power at the last change

Δ is the temperature change of the wire since the last change of the reading. Errors of the heat balance cancel, because
they are the same at both times. A large Δ with a constant reading is a fault.

A reading that changes may still rise too little. The least rise R of the wire by the power of the last second is

    dR/dt = (P - P̄)/C - R/τ,     C of the coldest wire that warms, P̄ the mean power, with the time constant τ

It is compared with the rise of the reading above its own mean. The short time τ, `UNFOLLOWED_S`, leaves out a power
that only makes up for a draft.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf, isfinite
from typing import NamedTuple

from smadrive.wire.heat_balance import BalanceSource, HeatBalance

TRANSFORMATION_C = 20.0
"""The wire takes up its latent heat over this span of temperature, K."""
SURROUNDINGS_C = 10.0
"""Largest difference between the surroundings and the ambient temperature of the heat balance, K."""
MARGIN_C = 6.0
"""Added on both sides of the band for noise and quantisation, K."""
UNFOLLOWED_S = 1.0
"""The heat input of about this time is compared with the rise of the reading, s."""
UNFOLLOWED_C = 5.0
"""A reading that stays behind the heat input of `UNFOLLOWED_S` by more than this is a fault, K."""
FROZEN_C = 3.0
"""A temperature change of the wire by more than this is a fault if the reading stays constant, K."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Largest factors, up or down, between the true capacity and loss of a wire and the values in its heat balance."""

    capacity: float
    loss: float


NOMINAL = Uncertainty(capacity=3.0, loss=1.6)
"""For a data sheet: published specific heats differ by a factor of 2.6. The factor of the loss holds for still air."""
IDENTIFIED = Uncertainty(capacity=1.5, loss=1.4)
"""For a heat balance that was identified on this rig; the loss includes some draft."""
UNCERTAINTIES = {BalanceSource.DATA_SHEET: NOMINAL, BalanceSource.IDENTIFIED: IDENTIFIED}
"""Uncertainty of a heat balance, by its source."""


class AtLeast(NamedTuple):
    """A lower bound of the wire's temperature, °C, and of its phase, by its displacement or by its resistance."""

    temperature_c: float
    phase: float


UNBOUNDED = AtLeast(-inf, 0.0)
"""No lower bound is known."""


class Band(NamedTuple):
    """The limits of the reading and of the wire's temperature that follow from the heat input."""

    low_c: float
    """The least possible reading of the thermocouple, °C."""
    high_c: float
    """The greatest possible reading of the thermocouple, °C."""
    coldest_c: float
    """The least possible temperature of the wire itself, °C."""
    hottest_c: float
    """The greatest possible temperature of the wire itself, °C."""
    unseen_c: float
    """The least possible temperature change of the wire since the reading last changed, K."""
    unfollowed_c: float
    """The part of the least rise by the power of the last second that the reading does not show, K."""


class TemperatureBand:
    """Computes the range of possible temperatures from the heat input, as described at the head of this file.

    `balance` is the heat balance of the wire with its `uncertainty`; `lag_s` is the lag of the thermocouple.
    """

    def __init__(self, balance: HeatBalance, uncertainty: Uncertainty, lag_s: float) -> None:
        self._capacity_j_per_k = uncertainty.capacity * balance.heat_capacity_j_per_k
        self._latent_j_per_k = uncertainty.capacity * balance.latent_heat_j / TRANSFORMATION_C
        slow = self._capacity_j_per_k + self._latent_j_per_k
        quick = balance.heat_capacity_j_per_k / uncertainty.capacity
        most_w_per_k, least_w_per_k = balance.loss_w_per_k * uncertainty.loss, balance.loss_w_per_k / uncertainty.loss
        self._ambient_c = balance.ambient_c
        self._coldest = _Wire(most_w_per_k, warming_j_per_k=slow, cooling_j_per_k=quick)
        self._hottest = _Wire(least_w_per_k, warming_j_per_k=quick, cooling_j_per_k=slow)
        self._unseen = _Wire(most_w_per_k, warming_j_per_k=slow, cooling_j_per_k=slow)
        self._lag_s = lag_s
        self.start(balance.ambient_c)

    def start(self, reading_c: float) -> None:
        """Start with a wire at rest at `reading_c`. The wire may be warmer or colder than its surroundings."""
        self._coldest.start(reading_c, min(self._ambient_c, reading_c) - SURROUNDINGS_C)
        self._hottest.start(reading_c, max(self._ambient_c, reading_c) + SURROUNDINGS_C)
        self._low_c = self._high_c = reading_c
        self._phase = 0.0
        self._mean_c, self._mean_w, self._rise_k, self._shown_k = reading_c, 0.0, 0.0, 0.0
        self._changed(reading_c, 0.0)

    def update(self, reading_c: float, power_w: float, dt_s: float, at_least: AtLeast = UNBOUNDED) -> Band:
        """Return the band after `dt_s` of heating with `power_w`; the thermocouple now reads `reading_c`."""
        is_cooling = power_w < self._coldest.holding_w()
        self._phase = at_least.phase if is_cooling else max(at_least.phase, self._phase)
        self._coldest.warming_j_per_k = self._capacity_j_per_k + (1.0 - self._phase) * self._latent_j_per_k
        coldest_c = max(self._coldest.step(power_w, dt_s), at_least.temperature_c)
        self._coldest.temperature_c = coldest_c
        hottest_c = self._hottest.step(power_w, dt_s)
        follow = 1.0 - exp(-dt_s / self._lag_s) if self._lag_s > 0 else 1.0
        self._low_c = min(self._low_c + follow * (coldest_c - self._low_c), coldest_c)
        self._high_c = max(self._high_c + follow * (hottest_c - self._high_c), hottest_c)
        unseen_c = self._unseen_c(reading_c, power_w, dt_s)
        unfollowed_c = self._unfollowed_c(reading_c, power_w, follow, dt_s)
        return Band(self._low_c - MARGIN_C, self._high_c + MARGIN_C, coldest_c, hottest_c, unseen_c, unfollowed_c)

    def _unfollowed_c(self, reading_c: float, power_w: float, follow: float, dt_s: float) -> float:
        """Return how far the reading stays behind the least rise by the power of the last second, K.

        `follow` is the part of a change that the thermocouple shows after `dt_s`.
        """
        keep = exp(-dt_s / UNFOLLOWED_S)
        settled_k = (power_w - self._mean_w) * UNFOLLOWED_S / self._coldest.warming_j_per_k
        self._rise_k = settled_k + (self._rise_k - settled_k) * keep
        self._mean_w = power_w + (self._mean_w - power_w) * keep
        self._shown_k = min(self._shown_k + follow * (self._rise_k - self._shown_k), self._rise_k)
        if not isfinite(reading_c):
            return 0.0
        self._mean_c = reading_c + (self._mean_c - reading_c) * keep
        return max(self._shown_k - max(reading_c - self._mean_c, 0.0), 0.0)

    def _unseen_c(self, reading_c: float, power_w: float, dt_s: float) -> float:
        if reading_c != self._reading_c:
            self._changed(reading_c, power_w)
            return 0.0
        self._still_s += dt_s
        moved_c = abs(self._unseen.step(power_w - self._power_then_w, dt_s))
        return moved_c if self._still_s > self._lag_s else 0.0

    def _changed(self, reading_c: float, power_w: float) -> None:
        self._reading_c = reading_c
        self._power_then_w = power_w
        self._still_s = 0.0
        self._unseen.start(0.0, 0.0)


class _Wire:
    """The heat balance of a wire with different heat capacities on warming and on cooling, in J/K."""

    def __init__(self, loss_w_per_k: float, *, warming_j_per_k: float, cooling_j_per_k: float) -> None:
        self._loss_w_per_k = loss_w_per_k
        self.warming_j_per_k = warming_j_per_k
        self._cooling_j_per_k = cooling_j_per_k

    def start(self, temperature_c: float, ambient_c: float) -> None:
        self.temperature_c = temperature_c
        self._ambient_c = ambient_c

    def holding_w(self) -> float:
        """Return the power that holds the temperature, W."""
        return self._loss_w_per_k * (self.temperature_c - self._ambient_c)

    def step(self, power_w: float, dt_s: float) -> float:
        settled_c = self._ambient_c + power_w / self._loss_w_per_k
        capacity = self.warming_j_per_k if settled_c > self.temperature_c else self._cooling_j_per_k
        decayed_c = (self.temperature_c - settled_c) * exp(-dt_s * self._loss_w_per_k / capacity)
        self.temperature_c = settled_c + decayed_c
        return self.temperature_c
