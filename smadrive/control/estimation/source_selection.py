"""Selection of the source of the displacement: a sensor, or the resistance of the wire.

A sensor can fail: it gives no reading, or readings that the wire cannot have. The resistance then replaces it. While
the sensor is valid, it calibrates the leads (lead.py), so the displacement does not jump when the source changes.

A sensor is implausible if it moves differently from the model while the resistance moves like the model. The difference
d of a source from the model is summed over the ticks, and forgotten with the time constant `FORGET_S`, so that a slow
error of the model does not count:

    d <- d exp(-Δt/FORGET_S) + (change of the source) - (change that the model predicts)

The sensor is implausible in a tick if all of this holds:

    the mean difference of sensor and resistance, with the weight `WEIGHT` of the latest sample, exceeds the limit
    |d| of the sensor exceeds the limit
    |d| of the resistance is less than half of |d| of the sensor

The limit is `MOST_SHARE` strokes, or `MOST_NOISES` standard deviations of the displacement by the resistance if that is
more. The sensor has failed after `FAILS_TICKS` implausible ticks in a row that last `FAILS_S` at least. If the sensor
agrees with the model and the resistance does not, a contact has changed, and the sensor stays the source.

    sensor --no reading, or implausible--> resistance --valid for RETURNS_TICKS ticks in a row, and agrees--> sensor
    sensor --implausible for as long--> failed: the resistance, until the end of the run
"""

from __future__ import annotations

from math import exp, inf, isfinite, nan
from typing import NamedTuple

from smadrive.control.estimation.lead import LeadChange
from smadrive.control.estimation.resistance_sensor import NO_READING, DisplacementReading, ResistanceSensor
from smadrive.control.estimation.wire_estimate import Prediction
from smadrive.measurement import DisplacementFrom, Measurement

FORGET_S = 3.0
MOST_SHARE, MOST_NOISES = 0.03, 2.5
WEIGHT = 0.2
FAILS_TICKS, FAILS_S = 5, 0.25
RETURNS_TICKS = 20
COLD_S = 2.5
"""Longest time for which the leads of the cold wire are measured at the beginning of a run, s."""


class SourceState(NamedTuple):
    """The state of the selection.

    lead                   state of the estimated leads
    apart_mm               difference d between the sensor and the model, mm
    resistance_apart_mm    difference d between the displacement by the resistance and the model, mm
    disagreement_mm        weighted mean of sensor - resistance, mm
    before_mm              displacement by the sensor in the last tick, mm; NaN if there was none
    resistance_before_mm   displacement by the resistance in the last tick, mm; NaN if there was none
    suspect_ticks          number of latest ticks in a row with an implausible sensor
    valid_ticks            number of latest ticks in a row with a plausible reading of the sensor
    has_sensor             True after the first reading of the sensor
    is_replaced            True while a sensor that has given a reading is not the source
    failed                 True once the sensor was implausible for long enough, until the end of the run
    source                 source of the last tick; NONE if the tick had no displacement
    cold_s                 time for which the leads of the cold wire were measured, s; inf once the wire has been warm
    """

    lead: LeadChange
    apart_mm: float = 0.0
    resistance_apart_mm: float = 0.0
    disagreement_mm: float = 0.0
    before_mm: float = nan
    resistance_before_mm: float = nan
    suspect_ticks: int = 0
    valid_ticks: int = 0
    has_sensor: bool = False
    is_replaced: bool = False
    failed: bool = False
    source: DisplacementFrom = DisplacementFrom.NONE
    cold_s: float = 0.0

    @property
    def needs_resistance(self) -> bool:
        """True if the resistance gave the displacement of the last tick, and always while it replaces the sensor."""
        return self.is_replaced or self.source is DisplacementFrom.RESISTANCE

    @property
    def is_sensor_wrong(self) -> bool:
        """True if the sensor has failed, or has given readings again for a while that the resistance contradicts."""
        return self.failed or (self.is_replaced and self.valid_ticks > RETURNS_TICKS)

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
        self._noise_mm, self._most_mm = noise_mm, MOST_SHARE * stroke_mm
        self._fails_ticks = max(FAILS_TICKS, round(FAILS_S / period_s))

    def start(self) -> SourceState:
        """Return the state before the first measurement."""
        lead = LeadChange.unknown(1.0) if self._resistance is None else self._resistance.unknown_lead()
        return SourceState(lead)

    def adopt(self, state: SourceState, before: SourceSelection) -> SourceState:
        """Return the state with which this selection continues from `state`, a state of the selection `before`.

        If both have the same chosen source, the result is `state`. Otherwise only the measured leads are kept, and
        that the sensor has failed.
        """
        if before._chosen is self._chosen:
            return state
        is_replaced = state.failed and self._chosen is DisplacementFrom.SENSOR
        kept = SourceState(state.lead, cold_s=state.cold_s, failed=state.failed)
        return kept._replace(has_sensor=is_replaced, is_replaced=is_replaced)

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
        sensor = self._sensor(measurement, prediction.mm_per_s)
        if self._resistance is None:
            source = DisplacementFrom.SENSOR if isfinite(sensor.mm) else DisplacementFrom.NONE
            state = state if state.source is source else state._replace(source=source)
            return state, Selected(sensor, NO_READING)
        sample = self._resistance.sample(measurement, prediction)
        by_resistance = self._resistance.displacement(state.lead, sample)
        if self._chosen is DisplacementFrom.SENSOR:
            state = self._compared(state, sensor, by_resistance, prediction.mm_per_s * dt_s, dt_s)
        source = self._source(state, sensor, by_resistance)
        trusted = sensor if source is DisplacementFrom.SENSOR and state.valid_ticks > RETURNS_TICKS else NO_READING
        lead = self._resistance.lead(state.lead, sample, trusted, dt_s)
        used = {DisplacementFrom.SENSOR: sensor, DisplacementFrom.RESISTANCE: by_resistance}.get(source, NO_READING)
        is_replaced = state.has_sensor and source is not DisplacementFrom.SENSOR
        cold_s = state.cold_s + dt_s * sample.shows_leads if sample.is_cold else inf
        state = state._replace(lead=lead, source=source, is_replaced=is_replaced, cold_s=cold_s)
        return state, Selected(used, by_resistance)

    def _sensor(self, measurement: Measurement, mm_per_s: float = 0.0) -> DisplacementReading:
        """Return the displacement by the sensor, advanced from the time of its reading at the rate `mm_per_s`.

        A displacement that is not fresh any more is no reading.
        """
        age_s, is_chosen = measurement.displacement_age_s, self._chosen is DisplacementFrom.SENSOR
        if not (is_chosen and isfinite(measurement.displacement_mm) and age_s <= self._fresh_s):
            return NO_READING
        return DisplacementReading(measurement.displacement_mm + mm_per_s * age_s, self._noise_mm)

    def _compared(
        self,
        state: SourceState,
        sensor: DisplacementReading,
        resistance: DisplacementReading,
        predicted_mm: float,
        dt_s: float,
    ) -> SourceState:
        """Return the state after sensor and resistance are compared with each other and with the model.

        `predicted_mm` is the change of the displacement that the model predicts for this tick.
        """
        keep = exp(-dt_s / FORGET_S)
        apart_mm = _apart(keep * state.apart_mm, state.before_mm, sensor.mm, predicted_mm)
        if state.has_sensor and not state.valid_ticks and not state.suspect_ticks and isfinite(resistance.mm):
            apart_mm = sensor.mm - resistance.mm  # the first reading after a gap
        other_mm = _apart(keep * state.resistance_apart_mm, state.resistance_before_mm, resistance.mm, predicted_mm)
        limit_mm = max(self._most_mm, MOST_NOISES * resistance.noise_mm)  # NaN noise: max returns the first
        latest_mm = sensor.mm - resistance.mm
        disagreement_mm = state.disagreement_mm + WEIGHT * (latest_mm - state.disagreement_mm)
        is_suspect = (
            abs(disagreement_mm) > limit_mm and abs(apart_mm) > limit_mm and abs(other_mm) < 0.5 * abs(apart_mm)
        )
        suspect_ticks = state.suspect_ticks + 1 if is_suspect else 0
        return state._replace(
            apart_mm=apart_mm,
            resistance_apart_mm=other_mm,
            disagreement_mm=disagreement_mm if isfinite(disagreement_mm) else state.disagreement_mm,
            before_mm=sensor.mm,
            resistance_before_mm=resistance.mm,
            suspect_ticks=suspect_ticks,
            valid_ticks=state.valid_ticks + 1 if isfinite(sensor.mm) and not is_suspect else 0,
            has_sensor=state.has_sensor or isfinite(sensor.mm),
            failed=state.failed or suspect_ticks >= self._fails_ticks,
        )

    def _source(
        self, state: SourceState, sensor: DisplacementReading, resistance: DisplacementReading
    ) -> DisplacementFrom:
        """Return the source of this tick."""
        by_resistance = DisplacementFrom.RESISTANCE if isfinite(resistance.mm) else DisplacementFrom.NONE
        if self._chosen is DisplacementFrom.RESISTANCE:
            return by_resistance
        if not state.has_sensor:
            return DisplacementFrom.NONE
        if state.failed or state.suspect_ticks or not isfinite(sensor.mm):
            return by_resistance
        agrees = state.valid_ticks > RETURNS_TICKS and abs(state.disagreement_mm) < self._most_mm
        return by_resistance if state.is_replaced and not agrees else DisplacementFrom.SENSOR


def _apart(apart_mm: float, before_mm: float, now_mm: float, predicted_mm: float) -> float:
    """Return the difference d of a source from the model after a tick; 0 without two displacements in a row."""
    change_mm = now_mm - before_mm - predicted_mm
    return apart_mm + change_mm if isfinite(change_mm) else 0.0
