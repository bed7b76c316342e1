"""The resistance of the wire as a displacement sensor.

The measured U/I, without the change of the leads (lead.py), gives the phase at the estimated temperature
(wire/identified_resistance.py), and so the displacement. Its standard deviation σ_d contains the noise of voltage and
current, and the errors that do not average out: those of the leads, of the fit and of the temperature.

    σ_d² = travel² [ (σ_U/I)² + N (σ_δ² + σ_fit² + (dR/dT σ_T)²) ] / (dR/dξ)²

The observer averages the samples of about half a second, N = `AVERAGED_S` / period, but at least `AVERAGED`. A constant
error counts N times, because the observer must not take N samples with the same error for a better one.

U/I is the resistance at a time `delay_s` before the measurement (wire/identified_resistance.py). So the change that the
model predicts for this delay is added.

While the wire cools, a sense current keeps the resistance observable (wire/observability.py).
"""

from __future__ import annotations

from math import isfinite, nan, sqrt
from typing import NamedTuple

from smadrive.control.estimation.lead import TEMPERATURE_C, LeadChange
from smadrive.control.estimation.wire_estimate import Prediction, WireEstimate
from smadrive.measurement import Measurement
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import COLD_PHASE, cold_c, sense_current
from smadrive.wire.wire_model import WireModel

AVERAGED, AVERAGED_S = 10.0, 0.5
"""Least number of samples over which the observer averages, and the time of these samples, s, approximately."""

SLOW_C_PER_S, FAST_C_PER_S = 12.0, 25.0
"""Limits for the measurement of the leads of a cold wire, K/s.

The largest current during this measurement heats the wire at the first rate, or it is the sense current if that is
larger. A sample does not count while the estimated temperature changes faster than the second rate.
"""

MOST_JUMP = 0.3
"""A sample that contradicts the known phase, or the range of the phase, by more than this share is wrong."""

MOST_NOISE = 0.3
"""A displacement with a larger standard deviation, in strokes, is not used."""


class DisplacementReading(NamedTuple):
    """A displacement and its standard deviation, mm. Both are NaN without a measurement.

    `is_new` is False for a displacement that a sensor had already given in an earlier tick.
    """

    mm: float
    noise_mm: float
    is_new: bool = True


NO_READING = DisplacementReading(nan, nan)


class ResistanceSample(NamedTuple):
    """One measurement of the resistance, and what the model predicts for its time.

    ohm             resistance, Ω; NaN without current or voltage
    variance        variance of `ohm` by the noise of voltage and current, Ω²
    temperature_c   predicted temperature, °C
    c_per_s         its predicted rate, K/s
    phase           predicted phase
    ohm_per_phase   dR/dξ at the predicted temperature and phase, Ω
    is_cold         True if the wire is so cold that it is martensite after any history
    shows_leads     True if the current is large enough to measure the leads of a cold wire
    """

    ohm: float
    variance: float
    temperature_c: float
    c_per_s: float
    phase: float
    ohm_per_phase: float
    is_cold: bool
    shows_leads: bool


class ResistanceSensor:
    """Measures the displacement of `wire` by its `resistance`.

    `cold_c` is the temperature below which the wire is martensite after any history. `floor_a` is the sense current,
    `cold_a` the largest current while the leads of the cold wire are measured. `period_s` is the period of the loop.
    """

    def __init__(self, wire: WireModel, resistance: WireResistance, period_s: float) -> None:
        self._wire, self._resistance = wire, resistance
        self._averaged = max(AVERAGED, AVERAGED_S / period_s)
        self._ohm_per_k = _ohm_per_k(wire, resistance)
        self._systematic = resistance.error_ohm**2 + (self._ohm_per_k * TEMPERATURE_C) ** 2
        middle_c = sum(wire.model.input_range) / 2.0
        self._most_jump_ohm = MOST_JUMP * abs(resistance.ohm(middle_c, 1.0) - resistance.ohm(middle_c, 0.0))
        self.cold_c = cold_c(wire, resistance)
        self.floor_a = sense_current(wire, resistance).current_a
        slow_w = SLOW_C_PER_S * wire.balance.heat_capacity_j_per_k
        self.cold_a = max(sqrt(slow_w / resistance.martensite_ohm), self.floor_a)

    def unknown_lead(self) -> LeadChange:
        """Return the state of the estimated leads before the first sample."""
        return LeadChange.unknown(self._resistance.martensite_ohm)

    def sample(self, measurement: Measurement, prediction: Prediction) -> ResistanceSample:
        """Return the sample in `measurement`; `prediction` is the prediction for its time, from the last estimate.

        The resistance is voltage / current, plus the predicted change over the delay of the measurement.
        """
        resistance, c_per_s = self._resistance, prediction.c_per_s
        temperature_c, phase = prediction.ahead.temperature_c, self._wire.phase(prediction.ahead.hysteresis)
        slope, current_a = resistance.ohm_per_phase(temperature_c, phase), measurement.current_a
        ohm = variance = nan
        if current_a > 0.0 and measurement.voltage_v > 0.0:
            ohm_per_s = slope * prediction.mm_per_s / self._wire.travel_mm + self._ohm_per_k * c_per_s
            ohm = measurement.voltage_v / current_a + ohm_per_s * resistance.delay_s
            variance = (resistance.noise_v / current_a) ** 2
        is_cold, shows_leads = self.is_cold(prediction.before), current_a > 0.5 * self.cold_a
        return ResistanceSample(ohm, variance, temperature_c, c_per_s, phase, slope, is_cold, shows_leads)

    def lead(self, lead: LeadChange, sample: ResistanceSample, sensor: DisplacementReading, dt_s: float) -> LeadChange:
        """Return the state of the estimated leads after `sample`; `lead` is the state `dt_s` before it.

        `sensor` is the displacement by a sensor. Without this displacement, the leads are measured only while the wire
        is cold.
        """
        resistance = self._resistance
        later = lead.later(resistance.martensite_ohm, dt_s)
        if isfinite(sensor.mm):
            phase = self._wire.phase_at(sensor.mm)
            noise = sensor.noise_mm / self._wire.travel_mm
        elif sample.is_cold:
            phase, noise = 0.0, COLD_PHASE
        else:
            return later
        if not isfinite(sample.ohm) or abs(sample.c_per_s) > FAST_C_PER_S:
            return later
        lead_ohm = sample.ohm - resistance.ohm(sample.temperature_c, phase)
        if abs(lead_ohm - lead.mean_ohm) > self._most_jump_ohm:
            return later
        slope = resistance.ohm_per_phase(sample.temperature_c, phase)
        return later.measured(lead_ohm, sample.variance + (slope * noise) ** 2)

    def displacement(self, lead: LeadChange, sample: ResistanceSample) -> DisplacementReading:
        """Return the displacement by the resistance; `lead` is the state of the estimated leads before `sample`.

        The result is `NO_READING` without current or voltage, if the standard deviation reaches `MOST_NOISE`, if the
        phase is far outside its range, if the resistance does not depend on the phase, and while the wire is cold,
        because its phase is then known to be 0.
        """
        slope, wire = sample.ohm_per_phase, self._wire
        if not isfinite(sample.ohm) or slope == 0.0 or sample.is_cold:
            return NO_READING
        lead_ohm, lead_variance = lead.estimate(self._systematic)
        phase = self._resistance.phase(sample.ohm - lead_ohm, sample.temperature_c, sample.phase)
        lasting = self._averaged * (lead_variance + self._systematic)
        noise = sqrt(sample.variance + lasting) / abs(slope)
        if not (noise < MOST_NOISE and -MOST_JUMP < phase < 1.0 + MOST_JUMP):
            return NO_READING
        return DisplacementReading(wire.displacement_mm(phase), noise * abs(wire.travel_mm))

    def is_cold(self, before: WireEstimate) -> bool:
        """Return True if the wire is so cold in the estimate `before` that it is martensite after any history.

        A smaller load lets the martensite form at lower temperatures.
        """
        return max(before.temperature_c, before.thermocouple_c) - min(before.shift_c, 0.0) < self.cold_c


def _ohm_per_k(wire: WireModel, resistance: WireResistance) -> float:
    """Return the mean slope of the resistance over the temperature at a constant phase, Ω/K."""
    low_c, high_c = wire.model.input_range
    rises = [resistance.ohm(high_c, phase) - resistance.ohm(low_c, phase) for phase in (0.0, 0.5, 1.0)]
    return sum(rises) / len(rises) / (high_c - low_c)
