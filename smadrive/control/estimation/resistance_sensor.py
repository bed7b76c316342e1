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
    """A displacement and its standard deviation, mm. Both are NaN without a measurement."""

    mm: float
    noise_mm: float


NO_READING = DisplacementReading(nan, nan)


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

    def lead(
        self,
        lead: LeadChange,
        measurement: Measurement,
        prediction: Prediction,
        sensor: DisplacementReading,
        dt_s: float,
    ) -> LeadChange:
        """Return the state of the estimated leads after a measurement; `lead` is the state before it.

        `prediction` is the prediction for the time of `measurement`, from the last estimate of the wire. `sensor` is
        the displacement by a sensor. Without this displacement, the leads are measured only while the wire is cold.
        """
        resistance, temperature_c = self._resistance, prediction.ahead.temperature_c
        later = lead.later(resistance.martensite_ohm, dt_s)
        if isfinite(sensor.mm):
            phase = self._wire.phase_at(sensor.mm)
            noise = sensor.noise_mm / self._wire.travel_mm
        elif self.is_cold(prediction.before):
            phase, noise = 0.0, COLD_PHASE
        else:
            return later
        slope = resistance.ohm_per_phase(temperature_c, phase)
        ohm = self._ohm(measurement, prediction, slope)
        if not isfinite(ohm) or abs(prediction.c_per_s) > FAST_C_PER_S:
            return later
        lead_ohm = ohm - resistance.ohm(temperature_c, phase)
        if abs(lead_ohm - lead.mean_ohm) > self._most_jump_ohm:
            return later
        variance = (resistance.noise_v / measurement.current_a) ** 2 + (slope * noise) ** 2
        return later.measured(lead_ohm, variance)

    def displacement(self, lead: LeadChange, measurement: Measurement, prediction: Prediction) -> DisplacementReading:
        """Return the displacement by the resistance; the method `lead` explains the arguments.

        The result is `NO_READING` without current or voltage, if the standard deviation reaches `MOST_NOISE`, if the
        phase is far outside its range, if the resistance does not depend on the phase, and while the wire is cold,
        because its phase is then known to be 0.
        """
        resistance, temperature_c, wire = self._resistance, prediction.ahead.temperature_c, self._wire
        start = wire.phase(prediction.ahead.hysteresis)
        slope = resistance.ohm_per_phase(temperature_c, start)
        ohm = self._ohm(measurement, prediction, slope)
        if not isfinite(ohm) or slope == 0.0 or self.is_cold(prediction.before):
            return NO_READING
        lead_ohm, lead_variance = lead.estimate(self._systematic)
        phase = resistance.phase(ohm - lead_ohm, temperature_c, start)
        lasting = self._averaged * (lead_variance + self._systematic)
        noise = sqrt((resistance.noise_v / measurement.current_a) ** 2 + lasting) / abs(slope)
        if not (noise < MOST_NOISE and -MOST_JUMP < phase < 1.0 + MOST_JUMP):
            return NO_READING
        return DisplacementReading(wire.displacement_mm(phase), noise * abs(wire.travel_mm))

    def is_cold(self, before: WireEstimate) -> bool:
        """Return True if the wire is so cold in the estimate `before` that it is martensite after any history.

        A smaller load lets the martensite form at lower temperatures.
        """
        return max(before.temperature_c, before.thermocouple_c) - min(before.shift_c, 0.0) < self.cold_c

    def measures_leads(self, measurement: Measurement) -> bool:
        """Return True if the current is large enough to measure the leads of a cold wire."""
        return measurement.current_a > 0.5 * self.cold_a

    def _ohm(self, measurement: Measurement, prediction: Prediction, slope: float) -> float:
        """Return the present resistance in Ω; NaN without current or voltage.

        It is voltage / current, plus the predicted change over the delay of the measurement. `slope` is dR/dξ.
        """
        if not measurement.current_a > 0.0 or not measurement.voltage_v > 0.0:
            return nan
        ohm_per_s = slope * prediction.mm_per_s / self._wire.travel_mm + self._ohm_per_k * prediction.c_per_s
        return measurement.voltage_v / measurement.current_a + ohm_per_s * self._resistance.delay_s


def _ohm_per_k(wire: WireModel, resistance: WireResistance) -> float:
    """Return the mean slope of the resistance over the temperature at a constant phase, Ω/K."""
    low_c, high_c = wire.model.input_range
    rises = [resistance.ohm(high_c, phase) - resistance.ohm(low_c, phase) for phase in (0.0, 0.5, 1.0)]
    return sum(rises) / len(rises) / (high_c - low_c)
