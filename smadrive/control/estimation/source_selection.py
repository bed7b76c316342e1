"""Selection of the source of the displacement: a sensor, or the resistance of the wire.

A sensor may be read more rarely than the loop runs. Between two readings the displacement is the last reading plus the
movement of the wire since then, by the model.

A sensor can fail: it gives no reading, or readings that the wire cannot have (source_comparison.py). The resistance
then replaces it. While the sensor is valid, it calibrates the leads (lead.py), so the displacement does not jump when
the source changes.

    sensor --no reading, or implausible--> resistance --valid for RETURNS_TICKS ticks in a row, and agrees--> sensor
    sensor --implausible for as long--> failed: the resistance, until the end of the run

While the resistance is wrong, it does not replace the sensor: without a reading of the sensor, the displacement is not
known.

A loose bead of the thermocouple reads too cold. The displacement by the resistance is then wrong, too, and must not
accuse the sensor. The observer takes the error of the temperature for a shift b < 0 of the transformation; while the
wire is heated fast, the error is larger. So the sensor is compared with a range of displacements:

    by the resistance at T ... by the resistance at T - `WRONG_SHIFTS` b̄      b̄ the mean of b < 0 over `SHIFT_S`

A sensor that slips changes b̄ by little, and late. A lower load shifts the transformation, too. After it, a slip to
higher readings is not found if it is within this range, which is up to some 10 % of the stroke wide.
"""

from __future__ import annotations

from math import exp, hypot, inf, isfinite
from typing import NamedTuple

from smadrive.control.estimation.lead import LeadChange
from smadrive.control.estimation.resistance_sensor import (
    NO_READING,
    DisplacementReading,
    ResistanceSample,
    ResistanceSensor,
)
from smadrive.control.estimation.source_comparison import Compared, SourceComparison
from smadrive.control.estimation.wire_estimate import Prediction
from smadrive.measurement import DisplacementFrom, Measurement

COLD_S = 2.5
"""Longest time for which the leads of the cold wire are measured at the beginning of a run, s."""

SHIFT_S, WRONG_SHIFTS = 1.0, 3.0
"""Time constant of the mean shift, s, and the largest error of the temperature, as a multiple of this shift."""


class SourceState(NamedTuple):
    """The state of the selection.

    lead          state of the estimated leads
    compared      state of the comparison of sensor and resistance
    is_replaced   True while a sensor that has given a reading is not the source
    source        source of the last tick; NONE if the tick had no displacement
    cold_s        time for which the leads of the cold wire were measured, s; inf once the wire has been warm
    shift_c       mean estimated shift of the transformation to colder temperatures, K: 0 or negative
    moved_mm      movement since the last reading of the sensor, by the model, mm; without a reading, since the start
    """

    lead: LeadChange
    compared: Compared = Compared()
    is_replaced: bool = False
    source: DisplacementFrom = DisplacementFrom.NONE
    cold_s: float = 0.0
    shift_c: float = 0.0
    moved_mm: float = 0.0

    @property
    def needs_resistance(self) -> bool:
        """True if the resistance gave the displacement of the last tick, and always while it replaces the sensor.

        A resistance that is wrong does not replace a sensor.
        """
        replaces = self.is_replaced and not self.compared.is_resistance_wrong
        return replaces or self.source is DisplacementFrom.RESISTANCE

    @property
    def in_force(self) -> DisplacementFrom:
        """The source in force: `RESISTANCE` if `needs_resistance`, else `source`. It may differ from the chosen one."""
        return DisplacementFrom.RESISTANCE if self.needs_resistance else self.source


class Selected(NamedTuple):
    """The displacement for the observer, `used`, and the displacement by the resistance."""

    used: DisplacementReading
    by_resistance: DisplacementReading


class SourceSelection:
    """Selects the displacement of each tick.

    `chosen` is the source that the user has chosen. `resistance` measures the displacement by the resistance; it is
    None if the resistance of the wire is not identified. `noise_mm` is the standard deviation of the noise of the
    displacement sensor, `stroke_mm` the stroke, `period_s` the period of the loop, `fresh_s` the age up to which a
    displacement is fresh.
    """

    def __init__(
        self,
        chosen: DisplacementFrom,
        resistance: ResistanceSensor | None,
        noise_mm: float,
        stroke_mm: float,
        period_s: float,
        fresh_s: float,
    ) -> None:
        self._chosen, self._resistance, self._fresh_s = chosen, resistance, fresh_s
        self._noise_mm, self._comparison = noise_mm, SourceComparison(stroke_mm, period_s)

    def start(self) -> SourceState:
        """Return the state before the first measurement."""
        lead = LeadChange.unknown(1.0) if self._resistance is None else self._resistance.unknown_lead()
        return SourceState(lead)

    def adopt(self, state: SourceState, before: SourceSelection) -> SourceState:
        """Return the state with which this selection continues from `state`, a state of the selection `before`.

        If both have the same chosen source, the result is `state`. Otherwise the source is not known yet, and the
        comparison begins anew, except that a sensor that was wrong stays wrong.
        """
        if before._chosen is self._chosen:
            return state
        is_replaced = state.compared.is_sensor_wrong and self._chosen is DisplacementFrom.SENSOR
        compared = state.compared.wrong_sensor()._replace(has_sensor=is_replaced)
        return state._replace(compared=compared, is_replaced=is_replaced, source=DisplacementFrom.NONE)

    def start_mm(self, measurement: Measurement) -> float:
        """Return the displacement of the sensor if the sensor is the chosen source, otherwise NaN."""
        return self._sensor(measurement).mm

    def floor_a(self, state: SourceState) -> float:
        """Return the least current in A that keeps the resistance observable; 0 while the resistance is not needed.

        If the resistance is the chosen source, it is also needed in a tick without a displacement: without current, the
        resistance could not be measured again.
        """
        is_needed = state.needs_resistance or self._chosen is DisplacementFrom.RESISTANCE
        return self._resistance.floor_a if self._resistance is not None and is_needed else 0.0

    def most_a(self, state: SourceState) -> float:
        """Return the largest current in A; infinite except at the beginning of a run by resistance.

        At the beginning the leads of the cold wire are measured, for at most `COLD_S`.
        """
        if self._resistance is None or self._chosen is not DisplacementFrom.RESISTANCE or state.cold_s > COLD_S:
            return inf
        return self._resistance.cold_a

    def update(
        self, state: SourceState, measurement: Measurement, prediction: Prediction, dt_s: float
    ) -> tuple[SourceState, Selected]:
        """Return the next state and the displacement of this tick, `dt_s` seconds after the last.

        `prediction` is the prediction for the time of `measurement`, from the last estimate of the wire.
        """
        is_new = measurement.displacement_age_s < dt_s
        held_s, moved_mm = (measurement.displacement_age_s, 0.0) if is_new else (dt_s, state.moved_mm)
        moved_mm += prediction.mm_per_s * held_s
        sensor = self._sensor(measurement, moved_mm, is_new=is_new)
        if self._resistance is None:
            source = DisplacementFrom.SENSOR if isfinite(sensor.mm) else DisplacementFrom.NONE
            return state._replace(source=source, moved_mm=moved_mm), Selected(sensor, NO_READING)
        sample = self._resistance.sample(measurement, prediction)
        by_resistance = self._resistance.displacement(state.lead, sample)
        if self._chosen is DisplacementFrom.SENSOR:
            shift_c = min(prediction.before.shift_c, 0.0)
            shift_c += (state.shift_c - shift_c) * exp(-dt_s / SHIFT_S)
            state = state._replace(shift_c=shift_c)
            closest = self._closest(state, sensor, by_resistance, sample)
            predicted_mm = prediction.mm_per_s * dt_s
            compared = self._comparison.update(state.compared, sensor, closest, predicted_mm, dt_s)
            state = state._replace(compared=compared)
        source = self._source(state, sensor, by_resistance)
        trusted = sensor if source is DisplacementFrom.SENSOR and state.compared.is_valid else NO_READING
        lead = self._resistance.lead(state.lead, sample, trusted, dt_s)
        used = {DisplacementFrom.SENSOR: sensor, DisplacementFrom.RESISTANCE: by_resistance}.get(source, NO_READING)
        is_replaced = state.compared.has_sensor and source is not DisplacementFrom.SENSOR
        cold_s = state.cold_s + dt_s * sample.shows_leads if sample.is_cold else inf
        state = state._replace(lead=lead, source=source, is_replaced=is_replaced, cold_s=cold_s, moved_mm=moved_mm)
        return state, Selected(used, by_resistance)

    def _sensor(self, measurement: Measurement, moved_mm: float = 0.0, *, is_new: bool = True) -> DisplacementReading:
        """Return the displacement by the sensor, advanced by the movement `moved_mm` since its reading.

        The standard deviation of this movement is as large as the movement. A displacement that is not fresh any more
        is no reading.
        """
        age_s, is_chosen = measurement.displacement_age_s, self._chosen is DisplacementFrom.SENSOR
        if not (is_chosen and isfinite(measurement.displacement_mm) and age_s <= self._fresh_s):
            return NO_READING
        noise_mm = hypot(self._noise_mm, moved_mm)
        return DisplacementReading(measurement.displacement_mm + moved_mm, noise_mm, is_new)

    def _closest(
        self, state: SourceState, sensor: DisplacementReading, at_t: DisplacementReading, sample: ResistanceSample
    ) -> DisplacementReading:
        """Return the displacement of the range by resistance that is nearest to the sensor.

        One end of the range is `at_t`, the displacement at the estimated temperature. If the sensor or an end is not
        measured, the result is `at_t`.
        """
        assert self._resistance is not None
        if not (isfinite(sensor.mm) and isfinite(at_t.mm)):
            return at_t
        warmer = sample._replace(temperature_c=sample.temperature_c - WRONG_SHIFTS * state.shift_c)
        other_mm = self._resistance.displacement(state.lead, warmer).mm
        if not isfinite(other_mm):
            return at_t
        low_mm, high_mm = sorted((at_t.mm, other_mm))
        return at_t._replace(mm=min(max(sensor.mm, low_mm), high_mm))

    def _source(
        self, state: SourceState, sensor: DisplacementReading, resistance: DisplacementReading
    ) -> DisplacementFrom:
        """Return the source of this tick."""
        by_resistance = DisplacementFrom.RESISTANCE if isfinite(resistance.mm) else DisplacementFrom.NONE
        if self._chosen is DisplacementFrom.RESISTANCE:
            return by_resistance
        compared, by_sensor = state.compared, DisplacementFrom.SENSOR
        if not compared.has_sensor:
            return DisplacementFrom.NONE
        if compared.is_resistance_wrong:
            return by_sensor if isfinite(sensor.mm) else DisplacementFrom.NONE
        if compared.failed or compared.suspect_ticks or not isfinite(sensor.mm):
            return by_resistance
        is_right = compared.is_valid and compared.agreeing_ticks > 0
        return by_resistance if state.is_replaced and not is_right else by_sensor
