"""The identified wire in steps: heat balance and hysteresis together.

Temperature and phase depend on each other: the transformation takes heat, and the temperature drives it. Over a small
change of temperature the slope dw/dT is constant, and the heat balance is exact. A larger change is divided into
pieces, each with its mean slope (the slope at its start, improved once). A state that a correction has put outside its
branches returns to them against the direction of the temperature; this is no transformation and takes no heat.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

from smadrive.hysteresis import DuhemModel, HysteresisModel, HysteresisState, TSFuzzyDuhem
from smadrive.wire.heat_balance import HeatBalance

SHORT_WAY_C = 0.1
"""Change of temperature over which the slope of the hysteresis counts as constant, K."""

PIECE_C = 2.0
"""Length of the pieces of a larger change, K."""

MOST_PIECES = 200
"""Most pieces of one step (400 K), so that an absurd power does not take the loop's time."""


class WireState(NamedTuple):
    """Wire temperature and the state of its hysteresis."""

    temperature_c: float
    hysteresis: HysteresisState


def travel_mm(model: HysteresisModel) -> tuple[float, float]:
    """Displacement of the cold and of the fully heated wire: the ends of the model's major loop."""
    cold_c, hot_c = model.input_range
    return model.initial_state(cold_c).y, model.initial_state(hot_c).y


class WireModel:
    """The identified wire as a model with `step`: state in, state out.

    The phase of the heat balance is the displacement over the travel, as it was when the balance was identified. The
    state w of the hysteresis model is another quantity: a model may use only a part of [0, 1].
    """

    def __init__(self, model: DuhemModel | TSFuzzyDuhem, balance: HeatBalance) -> None:
        self.model = model
        self.balance = balance
        self.cold_mm, hot_mm = travel_mm(model)
        self.travel_mm = hot_mm - self.cold_mm

    def step(self, state: WireState, power_w: float, dt_s: float) -> WireState:
        """The wire after `dt_s` at constant power."""
        last, after_c = self._way(state, power_w, dt_s)
        return self._moved(last, after_c)

    def temperature_c(self, state: WireState, power_w: float, dt_s: float) -> float:
        """The temperature after `dt_s` at constant power, for callers that step the hysteresis themselves."""
        return self._way(state, power_w, dt_s)[1]

    def _way(self, state: WireState, power_w: float, dt_s: float) -> tuple[WireState, float]:
        """The state at which the last piece of the way begins, and the temperature at its end."""
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
        """Temperature after one piece, at the end of which the slope at its start gives `after_c`."""
        wire_c, hysteresis = state
        way_c = after_c - wire_c
        if abs(way_c) <= SHORT_WAY_C:
            return after_c
        moved_mm = self.model.step(hysteresis, hysteresis.v + way_c).y - hysteresis.y
        per_k = max(moved_mm / self.travel_mm / way_c, 0.0)
        return self.balance.step(wire_c, power_w, per_k, dt_s)

    def _moved(self, state: WireState, after_c: float) -> WireState:
        """The wire at another temperature, its hysteresis moved by as much."""
        wire_c, hysteresis = state
        return WireState(after_c, self.model.step(hysteresis, hysteresis.v + after_c - wire_c))

    def _heated_c(self, state: WireState, power_w: float, dt_s: float) -> float:
        """Temperature after `dt_s` with the slope at the start."""
        settled_c = self.balance.ambient_c + power_w / self.balance.loss_w_per_k
        per_k = self.phase_per_k(state.hysteresis, 1 if settled_c > state.temperature_c else -1)
        return self.balance.step(state.temperature_c, power_w, per_k, dt_s)

    def phase_per_k(self, hysteresis: HysteresisState, direction: int) -> float:
        """Slope of the phase at a state, heating (+1) or cooling (-1), 1/K; never negative."""
        return max(self.model.slope(hysteresis, direction) / self.travel_mm, 0.0)

    def resistance_ohm(self, hysteresis: HysteresisState) -> float:
        """R at a state."""
        return self.balance.resistance_ohm(self.phase(hysteresis))

    def phase(self, hysteresis: HysteresisState) -> float:
        """Share of the travel."""
        return (hysteresis.y - self.cold_mm) / self.travel_mm
