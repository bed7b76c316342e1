"""The estimated state of a wire. It is the whole state of an observer, so another observer can continue from it."""

from __future__ import annotations

from typing import NamedTuple

from smadrive.control.estimation.innovation import DisturbanceEvidence
from smadrive.hysteresis import HysteresisState
from smadrive.hysteresis.reversal import Play


class WireEstimate(NamedTuple):
    """The estimated state of the wire.

    temperature_c    temperature of the wire, °C
    thermocouple_c   temperature of the thermocouple, °C
    hysteresis       state of the hysteresis model
    disturbance_w    power that the heat balance does not explain, W
    play             state of the dead band between the temperature and the hysteresis model
    radius_c         radius of the dead band, K
    evidence         state of the innovation test
    shift_c          shift of the transformation, K: the input of the hysteresis model is the temperature minus this
    """

    temperature_c: float
    thermocouple_c: float
    hysteresis: HysteresisState
    disturbance_w: float
    play: Play
    radius_c: float = 0.0
    evidence: DisturbanceEvidence = DisturbanceEvidence()
    shift_c: float = 0.0


class Prediction(NamedTuple):
    """The estimate `before` and the estimate `ahead` that the model predicts for a time `span_s` later, in s.

    The next measurement may come sooner or later than this.
    """

    before: WireEstimate
    ahead: WireEstimate
    span_s: float

    @property
    def mm_per_s(self) -> float:
        """The predicted rate of the displacement, mm/s."""
        return (self.ahead.hysteresis.y - self.before.hysteresis.y) / self.span_s

    @property
    def c_per_s(self) -> float:
        """The predicted rate of the temperature, K/s."""
        return (self.ahead.temperature_c - self.before.temperature_c) / self.span_s
