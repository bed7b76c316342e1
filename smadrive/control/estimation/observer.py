"""Estimate of wire temperature and phase from heater power, lagging thermocouple and, if measured, displacement.

State x = (T, T_tc, d, ξ): wire temperature, thermocouple temperature, a slowly drifting power d that the heat balance
does not explain (draft, wrong h A), and the phase. The measured displacement gives the phase. The prediction uses the
heat balance with the latent heat of the transformation, and the hysteresis model. The correction uses a Kalman gain.

The hysteresis model is linear only locally. Its rules i, at their firing strengths μ_i, give the slope of the phase
over the temperature, dξ/dT ∝ Σ μ_i (a_i w + b_i), with w the state of the hysteresis model. Along the loop only this
slope varies, so the gain is solved for several slopes and interpolated (see gain.py). Without a measured displacement,
the correction of ξ is the correction of T times dξ/dT. Only the predicted temperature steps the hysteresis model, and
only through a dead band: noise reverses the temperature, and each reversal would move the model along a minor loop
(ratcheting).

The estimate is the whole state of an observer, so another observer can continue from it.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from smadrive.control.estimation.gain import Correction, GainSchedule
from smadrive.hysteresis import HysteresisState
from smadrive.hysteresis.reversal import Play
from smadrive.wire.wire_model import WireModel, WireState

DEAD_BAND_NOISES = 0.2
"""Radius of the dead band, in standard deviations of the thermocouple's noise.

It is less than 1, because a predicted temperature has less noise than a reading.
"""


class WireEstimate(NamedTuple):
    """The estimated state of the wire.

    `temperature_c` is the temperature of the wire, `thermocouple_c` that of the thermocouple. `hysteresis` is the state
    of the hysteresis model. `disturbance_w` is the power that the heat balance does not explain. `play` is the state of
    the dead band between the temperature and the hysteresis model.
    """

    temperature_c: float
    thermocouple_c: float
    hysteresis: HysteresisState
    disturbance_w: float
    play: Play


class WireObserver:
    """Estimates wire temperature, thermocouple temperature, unexplained power and hysteresis state (Kalman filter).

    `noise_c` and `noise_mm` are the standard deviations of the noise of thermocouple (K) and displacement (mm). The
    gains are solved for updates every `period_s`.
    """

    def __init__(self, wire: WireModel, period_s: float, noise_c: float, noise_mm: float) -> None:
        self._wire = wire
        self._model = wire.model
        self._balance = wire.balance
        self._gains = GainSchedule(wire, period_s, noise_c, noise_mm)
        self._radius_c = DEAD_BAND_NOISES * noise_c

    def start(self, reading_c: float, displacement_mm: float) -> WireEstimate:
        """Return the first estimate, for a wire at rest.

        Without a measured displacement (NaN), the hysteresis state lies on the heating branch.
        """
        measured_mm = displacement_mm if isfinite(displacement_mm) else None
        hysteresis = self._model.initial_state(reading_c, measured_mm)
        return WireEstimate(reading_c, reading_c, hysteresis, 0.0, Play(reading_c))

    def adopt(self, estimate: WireEstimate) -> WireEstimate:
        """Return the estimate of another observer, converted to the model of this observer.

        The temperatures stay. The displacement becomes the nearest displacement that the model of this observer can
        have.
        """
        return estimate._replace(hysteresis=self._model.initial_state(estimate.hysteresis.v, estimate.hysteresis.y))

    def predict(self, before: WireEstimate, power_w: float, dt_s: float) -> WireEstimate:
        """Return the estimate `dt_s` seconds after `before`, for a wire heated with `power_w`, by the model alone."""
        total_w = power_w + before.disturbance_w
        wire_c = self._wire.temperature_c(WireState(before.temperature_c, before.hysteresis), total_w, dt_s)
        read_c = self._balance.step_thermocouple(before.thermocouple_c, before.temperature_c, wire_c, dt_s)
        play = before.play.moved(wire_c, self._radius_c)
        hysteresis = self._model.step(before.hysteresis, play.output(self._radius_c))
        return WireEstimate(wire_c, read_c, hysteresis, before.disturbance_w, play)

    def update(
        self, before: WireEstimate, reading_c: float, displacement_mm: float, power_w: float, dt_s: float
    ) -> WireEstimate:
        """Return the estimate `dt_s` seconds after `before`, corrected by the measurements at this time.

        The wire was heated with `power_w` since `before`. `reading_c` is the reading of the thermocouple. NaN marks a
        missing measurement.
        """
        expected = self.predict(before, power_w, dt_s)
        slope = self._wire.phase_per_k(expected.hysteresis, expected.play.direction or 1)
        read_c = reading_c - expected.thermocouple_c if isfinite(reading_c) else 0.0
        if not isfinite(displacement_mm):
            correction = self._gains.by_reading(slope, read_c)
            return self._corrected(expected, correction, self._shifted(expected, correction))
        seen = (displacement_mm - expected.hysteresis.y) / self._wire.travel_mm
        correction = self._gains.by_both(slope, read_c, seen)
        v, y = expected.hysteresis.v + correction.temperature_c, self._wire.travel_mm * correction.phase
        hysteresis = self._model.corrected(expected.hysteresis, v, expected.hysteresis.y + y)
        return self._corrected(expected, correction, hysteresis)

    def _shifted(self, expected: WireEstimate, correction: Correction) -> HysteresisState:
        """Return the state of the hysteresis at the corrected temperature. The phase follows the temperature."""
        v = expected.hysteresis.v + correction.temperature_c
        return self._model.shifted(expected.hysteresis, v, expected.play.direction or 1)

    def _corrected(self, expected: WireEstimate, correction: Correction, hysteresis: HysteresisState) -> WireEstimate:
        """Return the estimate with the correction of (T, T_tc, d) added, and with the corrected `hysteresis`.

        The input of the hysteresis model moves with the temperature, but the model makes no step: the correction of
        the phase already contains the effect of the temperature.
        """
        wire_c, thermocouple_c, power_w, _ = correction
        return WireEstimate(
            expected.temperature_c + wire_c,
            expected.thermocouple_c + thermocouple_c,
            hysteresis,
            expected.disturbance_w + power_w,
            Play(expected.play.position + wire_c, expected.play.direction),
        )
