"""Steps of the identified wire: heat balance and hysteresis together.

Temperature and phase depend on each other: the transformation takes heat, and the temperature drives the
transformation. Over a small change of temperature the slope dw/dT counts as constant, and the heat balance is solved
exactly. A larger change is divided into pieces. Each piece is computed with the slope at its start, then once more with
its mean slope.

A correction of the observer may put the state outside the branches of the hysteresis model, where the slope may have
the wrong sign. A negative slope counts as zero: the state then only returns to the branches, which takes no heat.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple, TypeVar

from smadrive.hysteresis import HysteresisModel, HysteresisState, IdentifiedModel
from smadrive.numerics.arrays import FloatArray
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance

NumberT = TypeVar("NumberT", float, FloatArray)

SHORT_WAY_C = 0.1
"""Change of temperature over which the slope of the hysteresis counts as constant, K."""

PIECE_C = 2.0
"""Length of the pieces of a larger change, K."""

MOST_PIECES = 200
"""Largest number of pieces in one step. It bounds the computing time when the power is impossibly large."""


class WireState(NamedTuple):
    """Temperature of the wire in °C, and the state of its hysteresis model."""

    temperature_c: float
    hysteresis: HysteresisState


class Travel(NamedTuple):
    """The displacements of the cold and of the fully heated wire, in mm."""

    cold_mm: float
    hot_mm: float

    @property
    def stroke_mm(self) -> float:
        """The distance between the two ends, in mm; it is positive."""
        return abs(self.hot_mm - self.cold_mm)

    def at_mm(self, phase: NumberT) -> NumberT:
        """Return the displacement in mm at a phase: 0 for the cold wire, 1 for the fully heated wire."""
        return self.cold_mm + phase * (self.hot_mm - self.cold_mm)


def travel_mm(model: HysteresisModel) -> Travel:
    """Return the travel of a model: the ends of its major loop."""
    cold_c, hot_c = model.input_range
    return Travel(model.initial_state(cold_c).y, model.initial_state(hot_c).y)


class WireModel:
    """The identified wire as a model: `step` takes a state of the wire and returns the next one.

    The phase of the heat balance is the displacement as a share of the travel, as in the identification of the heat
    balance. It differs from the state w of the hysteresis model, because a model may use only a part of the range
    [0, 1] of w.

    `resistance` is the identified resistance over temperature and phase. Without it, the resistance is that of the heat
    balance, which depends on the phase alone.
    """

    def __init__(self, model: IdentifiedModel, balance: HeatBalance, resistance: WireResistance | None = None) -> None:
        self.model = model
        self.balance = balance
        self.resistance = resistance
        self.cold_mm, hot_mm = travel_mm(model)
        self.travel_mm = hot_mm - self.cold_mm

    def step(self, state: WireState, power_w: float, dt_s: float) -> WireState:
        """Return the state of the wire after `dt_s` at constant power."""
        last, after_c = self._way(state, power_w, dt_s)
        return self._moved(last, after_c)

    def temperature_c(self, state: WireState, power_w: float, dt_s: float) -> float:
        """Return the temperature in °C after `dt_s` at constant power. The caller steps the hysteresis separately."""
        return self._way(state, power_w, dt_s)[1]

    def _way(self, state: WireState, power_w: float, dt_s: float) -> tuple[WireState, float]:
        """Return the state at the start of the last piece of the temperature change, and the temperature at its end."""
        after_c = self._heated_c(state, power_w, dt_s)
        pieces = min(ceil(abs(after_c - state.temperature_c) / PIECE_C), MOST_PIECES)
        if pieces > 1:
            dt_s /= pieces
            for _ in range(pieces - 1):
                after_c = self._heated_c(state, power_w, dt_s)
                state = self._moved(state, self._improved_c(state, after_c, power_w, dt_s))
            after_c = self._heated_c(state, power_w, dt_s)
        return state, self._improved_c(state, after_c, power_w, dt_s)

    def _improved_c(self, state: WireState, after_c: float, power_w: float, dt_s: float) -> float:
        """Return the temperature after one piece, computed with the mean slope of the piece.

        `after_c` is the temperature computed with the slope at the start; it is exact for a change up to `SHORT_WAY_C`.
        """
        wire_c, hysteresis = state
        way_c = after_c - wire_c
        if abs(way_c) <= SHORT_WAY_C:
            return after_c
        moved_mm = self.model.step(hysteresis, hysteresis.v + way_c).y - hysteresis.y
        per_k = max(moved_mm / self.travel_mm / way_c, 0.0)
        return self.balance.step(wire_c, power_w, per_k, dt_s)

    def _moved(self, state: WireState, after_c: float) -> WireState:
        """Return the state of the wire at the temperature `after_c`. The hysteresis steps by the same change."""
        wire_c, hysteresis = state
        return WireState(after_c, self.model.step(hysteresis, hysteresis.v + after_c - wire_c))

    def _heated_c(self, state: WireState, power_w: float, dt_s: float) -> float:
        """Return the temperature in °C after `dt_s`, computed with the slope dw/dT at the start of this time."""
        settled_c = self.balance.ambient_c + power_w / self.balance.loss_w_per_k
        per_k = self.phase_per_k(state.hysteresis, 1 if settled_c > state.temperature_c else -1)
        return self.balance.step(state.temperature_c, power_w, per_k, dt_s)

    def phase_per_k(self, hysteresis: HysteresisState, direction: int) -> float:
        """Return the slope of the phase on heating (direction +1) or cooling (-1), in 1/K; it is never negative."""
        return max(self.model.slope(hysteresis, direction) / self.travel_mm, 0.0)

    def resistance_ohm(self, hysteresis: HysteresisState, temperature_c: float) -> float:
        """Return the resistance of the wire in Ω at a temperature and at a state of its hysteresis model."""
        if self.resistance is not None:
            return self.resistance.ohm(temperature_c, self.phase(hysteresis))
        return self.balance.resistance_ohm(self.phase(hysteresis))

    def phase(self, hysteresis: HysteresisState) -> float:
        """Return the phase at a state of the hysteresis: 0 for the cold wire, 1 for the fully heated wire."""
        return (hysteresis.y - self.cold_mm) / self.travel_mm

    def phase_at(self, displacement_mm: NumberT) -> NumberT:
        """Return the phase at a displacement in mm."""
        return (displacement_mm - self.cold_mm) / self.travel_mm

    def displacement_mm(self, phase: NumberT) -> NumberT:
        """Return the displacement in mm at a phase."""
        return self.cold_mm + self.travel_mm * phase
