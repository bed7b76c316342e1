"""Where the wire is: temperature and phase, from heater power, a lagging thermocouple and, where there is one, the
displacement.

State x = (T, T_tc, d, ξ): wire temperature, thermocouple temperature, a slowly drifting power d that the heat balance
does not explain (draught, wrong h A), and the phase, seen in the displacement. The prediction is the heat balance with
the transformation's latent heat, and the hysteresis model itself; the correction is a Kalman gain.

The model is linear only locally. Its rules, at their present firing strengths, say how the phase moves with the
temperature, dξ/dT ∝ Σ μ_i (a_i w + b_i), and that slope is all in which one place of the loop differs from another: so
the gain is solved for a row of slopes and taken from there (see observer_gain). Without a displacement ξ is not
corrected by itself: it moves with the correction of the temperature along the slope. Only the predicted temperature
makes the model step, and through a dead band, for noise that turns back and forth would ratchet it.

Nothing is hidden: an estimate is all that an observer knows, and any observer can go on from it.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from smadrive.control.estimation.gain import Correction, GainSchedule
from smadrive.hysteresis import HysteresisState
from smadrive.wire.wire_model import WireModel, WireState

DEAD_BAND_NOISES = 0.2
"""Radius of the reversal dead band in standard deviations of the thermocouple's noise (a prediction is quieter)."""


class WireEstimate(NamedTuple):
    """What the observer believes.

    Temperatures of wire and thermocouple, hysteresis state (v, w, y), the power that the balance misses; `play_c` and
    `play_direction` are the state of the dead band between temperature and hysteresis.
    """

    temperature_c: float
    thermocouple_c: float
    hysteresis: HysteresisState
    disturbance_w: float
    play_c: float
    play_direction: int


class WireObserver:
    """The observer above.

    `noise_c` and `noise_mm` are the standard deviations of thermocouple and displacement, `period_s` the nominal update
    period for which the gains are solved.
    """

    def __init__(self, wire: WireModel, period_s: float, noise_c: float, noise_mm: float) -> None:
        self._wire = wire
        self._model = wire.model
        self._balance = wire.balance
        self._gains = GainSchedule(wire, period_s, noise_c, noise_mm)
        self._radius_c = DEAD_BAND_NOISES * noise_c

    def start(self, reading_c: float, displacement_mm: float) -> WireEstimate:
        """The estimate for a wire at rest: at the displacement, if it is measured, else on the heating branch."""
        measured_mm = displacement_mm if isfinite(displacement_mm) else None
        hysteresis = self._model.initial_state(reading_c, measured_mm)
        return WireEstimate(reading_c, reading_c, hysteresis, 0.0, reading_c, 0)

    def adopt(self, estimate: WireEstimate) -> WireEstimate:
        """Another observer's estimate for this one's model: the same temperatures, the same displacement."""
        return estimate._replace(hysteresis=self._model.initial_state(estimate.hysteresis.v, estimate.hysteresis.y))

    def predict(self, before: WireEstimate, power_w: float, dt_s: float) -> WireEstimate:
        """The estimate `dt_s` later, with `power_w` applied and nothing measured."""
        total_w = power_w + before.disturbance_w
        wire_c = self._wire.temperature_c(WireState(before.temperature_c, before.hysteresis), total_w, dt_s)
        read_c = self._balance.step_thermocouple(before.thermocouple_c, before.temperature_c, wire_c, dt_s)
        play_c = min(max(before.play_c, wire_c - self._radius_c), wire_c + self._radius_c)
        direction = before.play_direction
        if play_c != before.play_c:
            direction = 1 if play_c > before.play_c else -1
        hysteresis = self._model.step(before.hysteresis, play_c + direction * self._radius_c)
        return WireEstimate(wire_c, read_c, hysteresis, before.disturbance_w, play_c, direction)

    def update(
        self, before: WireEstimate, reading_c: float, displacement_mm: float, power_w: float, dt_s: float
    ) -> WireEstimate:
        """The estimate `dt_s` after `before`, with `power_w` applied since; NaN for what was not measured now."""
        expected = self.predict(before, power_w, dt_s)
        slope = self._wire.phase_per_k(expected.hysteresis, expected.play_direction or 1)
        read_c = reading_c - expected.thermocouple_c if isfinite(reading_c) else 0.0
        if not isfinite(displacement_mm):
            return self._corrected(expected, self._gains.by_reading(slope, read_c))
        seen = (displacement_mm - expected.hysteresis.y) / self._wire.travel_mm
        return self._corrected(expected, self._gains.by_both(slope, read_c, seen))

    def _corrected(self, expected: WireEstimate, correction: Correction) -> WireEstimate:
        """The estimate moved by (T, T_tc, d, ξ) at once.

        The hysteresis input moves with the temperature but makes no step: what the correction of the temperature means
        for the phase is part of the correction of the phase.
        """
        wire_c, thermocouple_c, power_w, phase = correction
        v, y, _ = expected.hysteresis
        return WireEstimate(
            expected.temperature_c + wire_c,
            expected.thermocouple_c + thermocouple_c,
            self._model.initial_state(v + wire_c, y + self._wire.travel_mm * phase),
            expected.disturbance_w + power_w,
            expected.play_c + wire_c,
            expected.play_direction,
        )
