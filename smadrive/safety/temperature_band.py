"""The range of temperatures that the heat input allows: a check that does not rely on the thermocouple.

Possible wires bracket the true wire. The coldest possible wires lose much heat, and one of them is the coldest at each
time: that with the greatest heat capacity after a rise, that with the smallest after a fall. The hottest possible wire
warms fast, loses little heat, and cools slowly:

    coldest: C = u_c m c, m c and m c / u_c, and the latent heat u_q Q at u_c Q / span;  h A · u_h;  colder surroundings
    hottest: C = m c / u_c while it warms, u_c (m c + Q / span) while it cools;  h A / u_h;  warmer surroundings

C is the heat capacity that each balance uses. m c, Q and h A are the heat capacity, the latent heat and the heat loss
of the nominal heat balance, u_c and u_h the uncertainties, u_q is `LATENT`, and span is `TRANSFORMATION_C`.
bounding_wire.py tells how often a wire takes up its latent heat. The reading must lie between the two temperatures, ±
`MARGIN_C`; the lag of the thermocouple is applied to each of them only where this widens the band. A displacement or
resistance that needs a warmer wire raises the temperature of the coldest wires; a wire of the phase ξ takes up only the
share 1 - ξ of Q. The reading leaves the band if the bead falls off, if the thermocouple is reversed, or if the wire
receives heat that is not measured.

A frozen reading, which does not change even in its last digit, is detected sooner, from the power since its last
change:

    C dΔ/dt = P - P₀ - h A Δ,     C and h A of the coldest wire that warms, P the power, P₀ the power at the last change

Δ is the temperature change of the wire since the last change of the reading. Errors of the heat balance cancel, because
they are the same at both times. A large Δ with a constant reading is a fault. P₀ stands for the heat loss at that time,
which follows the power with the time constant of the wire. So Δ is computed a second time, with the mean power of this
time constant as P₀, and the smaller Δ counts.

A reading that changes may still rise too little. The least rise R of the wire by the power of the last second is

    dR/dt = (P - P̄)/C - R/τ,     C of the coldest wire that warms, P̄ the mean power, with the time constant τ

At first P̄ is the power that holds the reading. R is compared with the rise of the reading above its own mean. The
short time τ, `UNFOLLOWED_S`, leaves out a power that only makes up for a draft.

A run that begins soon after another one goes on with its band. Once the thermocouple has settled, the band begins at
the reading, but no colder than the coldest wire of the last run has become: a bead without contact reads the same cold
temperature before every run, while each run heats the wire further.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf, isfinite
from typing import NamedTuple

from smadrive.safety.bounding_wire import BoundingWire, ColdestWire, Shown, SimpleWire
from smadrive.wire.heat_balance import BalanceSource, HeatBalance

TRANSFORMATION_C = 20.0
"""The wire takes up its latent heat over this span of temperature, K."""
SURROUNDINGS_C = 10.0
"""Largest difference between the surroundings and the ambient temperature of the heat balance, K."""
MARGIN_C = 6.0
"""Added on both sides of the band for noise and quantisation, K."""
LATENT = 1.5
"""Largest factor between the latent heat of the whole wire and that of its heat balance."""
UNFOLLOWED_S = 1.0
"""The heat input of about this time is compared with the rise of the reading, s."""
UNFOLLOWED_C = 5.0
"""A reading that stays behind the heat input of `UNFOLLOWED_S` by more than this is a fault, K."""
SETTLED_LAGS = 2.0
"""The thermocouple of a wire at rest has settled after this multiple of the longest possible lag."""
FROZEN_C = 3.0
"""A temperature change of the wire by more than this is a fault if the reading stays constant, K."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Largest factors, up or down, between the true values of a wire and those in its heat balance."""

    capacity: float  # and of the latent heat per K
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


class Heated(NamedTuple):
    """The coldest possible wires and the hottest possible wire at the time `time_s`, in s."""

    time_s: float
    coldest: tuple[Shown, Shown, Shown]
    hottest: Shown


class TemperatureBand:
    """Computes the range of possible temperatures from the heat input, as described at the head of this file.

    `balance` is the heat balance of the wire with its `uncertainty`, `lag_s` the lag of the thermocouple, and `last`
    the wire at the end of the last run, or None.
    """

    def __init__(
        self, balance: HeatBalance, uncertainty: Uncertainty, lag_s: float, last: Heated | None = None
    ) -> None:
        nominal, factor = balance.heat_capacity_j_per_k, uncertainty.capacity
        self._capacity_j_per_k = factor * nominal
        self._latent_j_per_k = factor * balance.latent_heat_j / TRANSFORMATION_C
        slow, quick = self._capacity_j_per_k + self._latent_j_per_k, nominal / factor
        self._most_w_per_k = most_w_per_k = balance.loss_w_per_k * uncertainty.loss
        least_w_per_k = balance.loss_w_per_k / uncertainty.loss
        self._ambient_c = balance.ambient_c
        self._coldest = tuple(
            ColdestWire(most_w_per_k, capacity, LATENT * balance.latent_heat_j, self._latent_j_per_k)
            for capacity in (factor * nominal, nominal, quick)
        )
        self._hottest = BoundingWire(least_w_per_k, max, warming_j_per_k=quick, cooling_j_per_k=slow)
        self._unseen = tuple(SimpleWire(most_w_per_k, warming_j_per_k=slow, cooling_j_per_k=slow) for _ in range(2))
        self._time_constant_s = balance.time_constant_s
        self._lag_s = lag_s
        self._last = last
        self._time_s: float | None = None
        self._begin(balance.ambient_c)

    @property
    def heated(self) -> Heated | None:
        """The possible wires now. Before the start of the run: at the end of the last run, None without one."""
        if self._time_s is None:
            return self._last
        slow, nominal, quick = (wire.shown for wire in self._coldest)
        return Heated(self._time_s, (slow, nominal, quick), self._hottest.shown)

    def start(self, reading_c: float, time_s: float) -> float:
        """Start with a wire at rest at `reading_c`. Return the least possible reading, °C.

        The wire may be warmer or colder than its surroundings, but not colder than the last run has left it.
        """
        self._begin(reading_c)
        self._time_s = time_s
        if self._last is not None:
            self._resume(self._last, reading_c, time_s - self._last.time_s)
        return min(wire.reading_c for wire in self._coldest) - MARGIN_C

    def _resume(self, last: Heated, reading_c: float, dt_s: float) -> None:
        """Go on with the wires of the last run, which have cooled for `dt_s`."""
        is_settled = dt_s > SETTLED_LAGS * self._lag_s
        for wire, shown in zip(self._coldest, last.coldest, strict=True):
            wire.resume(shown)
        if not is_settled:
            self._hottest.resume(last.hottest)
        self._step(0.0, dt_s)
        if is_settled:
            for wire in self._coldest:
                left = wire.shown
                wire.resume(Shown(max(left.wire_c, reading_c), max(left.reading_c, reading_c), left.latent_j))

    def _begin(self, reading_c: float) -> None:
        for wire in self._coldest:
            wire.start(reading_c, min(self._ambient_c, reading_c) - SURROUNDINGS_C)
        self._hottest.start(reading_c, max(self._ambient_c, reading_c) + SURROUNDINGS_C)
        self._phase = 0.0
        self._mean_c, self._mean_w = reading_c, self._most_w_per_k * max(reading_c - self._ambient_c, 0.0)
        self._rise_k, self._shown_k = 0.0, 0.0
        self._lost_w = 0.0
        self._changed(reading_c, 0.0)

    def update(self, reading_c: float, power_w: float, time_s: float, at_least: AtLeast = UNBOUNDED) -> Band:
        """Return the band at `time_s`, after heating with `power_w`. The thermocouple now reads `reading_c`."""
        dt_s = 0.0 if self._time_s is None else time_s - self._time_s
        self._time_s = time_s
        is_cooling = any(power_w < wire.holding_w() for wire in self._coldest)
        self._phase = at_least.phase if is_cooling else max(at_least.phase, self._phase)
        for wire in self._coldest:
            wire.untransformed = 1.0 - self._phase
        followed = self._step(power_w, dt_s, at_least.temperature_c)
        coldest_c = min(wire.temperature_c for wire in self._coldest)
        low_c = min(wire.reading_c for wire in self._coldest)
        hottest_c, high_c, _ = self._hottest.shown
        unseen_c = self._unseen_c(reading_c, power_w, dt_s)
        unfollowed_c = self._unfollowed_c(reading_c, power_w, followed, dt_s)
        return Band(low_c - MARGIN_C, high_c + MARGIN_C, coldest_c, hottest_c, unseen_c, unfollowed_c)

    def _step(self, power_w: float, dt_s: float, at_least_c: float = -inf) -> float:
        """Heat the possible wires. Return the part of a change that the thermocouple shows after `dt_s`."""
        followed = 1.0 - exp(-dt_s / self._lag_s) if self._lag_s > 0 else 1.0
        for wire in self._coldest:
            wire.temperature_c = max(wire.step(power_w, dt_s), at_least_c)
            wire.show(followed)
        self._hottest.step(power_w, dt_s)
        self._hottest.show(followed)
        return followed

    def _unfollowed_c(self, reading_c: float, power_w: float, followed: float, dt_s: float) -> float:
        """Return how far the reading stays behind the least rise by the power of the last second, K.

        `followed` is the part of a change that the thermocouple shows after `dt_s`.
        """
        keep = exp(-dt_s / UNFOLLOWED_S)
        slow = self._capacity_j_per_k + (1.0 - self._phase) * self._latent_j_per_k
        settled_k = (power_w - self._mean_w) * UNFOLLOWED_S / slow
        self._rise_k = settled_k + (self._rise_k - settled_k) * keep
        self._mean_w = power_w + (self._mean_w - power_w) * keep
        self._shown_k = min(self._shown_k + followed * (self._rise_k - self._shown_k), self._rise_k)
        if not isfinite(reading_c):
            return 0.0
        self._mean_c = reading_c + (self._mean_c - reading_c) * keep
        return max(self._shown_k - max(reading_c - self._mean_c, 0.0), 0.0)

    def _unseen_c(self, reading_c: float, power_w: float, dt_s: float) -> float:
        self._lost_w = power_w + (self._lost_w - power_w) * exp(-dt_s / self._time_constant_s)
        if isfinite(reading_c) and reading_c != self._reading_c:
            self._changed(reading_c, power_w)
            return 0.0
        self._still_s += dt_s
        moved_c = [
            abs(wire.step(power_w - then_w, dt_s))
            for wire, then_w in zip(self._unseen, self._powers_then_w, strict=True)
        ]
        return min(moved_c) if isfinite(reading_c) and self._still_s > self._lag_s else 0.0

    def _changed(self, reading_c: float, power_w: float) -> None:
        self._reading_c = reading_c
        self._powers_then_w = power_w, self._lost_w
        self._still_s = 0.0
        for wire in self._unseen:
            wire.start(0.0, 0.0)
