"""The controller that makes a wire follow a displacement reference.

    measurement → observer → advance by one period → inverse feedforward with preview → setpoint filter
                → temperature feedback → power → current

A command acts one period after its measurement. So the observer advances its estimate by one period, with the power
that is in force during this period. The controller computes the command from the advanced estimate.

The state of a controller is an immutable tuple, so another controller can take over this state. A controller with
another reference, model or setting then continues without a jump of the command, unless the error is large.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.tracking_feedback import TrackingFeedback, TrackingSettings
from smadrive.control.controllers.trim import DisplacementTrim
from smadrive.control.estimation.observer import WireObserver
from smadrive.control.estimation.prediction import heating_w
from smadrive.control.estimation.resistance_sensor import DisplacementReading, ResistanceSensor
from smadrive.control.estimation.source_selection import SourceSelection, SourceState
from smadrive.control.estimation.wire_estimate import Prediction, WireEstimate
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.feedforward.power import DisplacementFeedforward, Feedforward
from smadrive.control.feedforward.reversal_preview import Reversal, ReversalPreview
from smadrive.control.feedforward.setpoint_filter import SetpointFilter
from smadrive.control.references.reference import Reference
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.wire.wire_model import WireModel

DISPLACEMENT_NOISE = 0.001
"""Assumed standard deviation of the noise of a displacement sensor, in strokes."""


class TrackingState(NamedTuple):
    """State of a TrackingController, without the state of its feedback.

    prediction  estimated state of the wire at the last measurement, and its prediction for the next one
    power_w     power of the last command, W
    trim_mm     displacement trim, mm
    direction   +1 while the phase rises, -1 while the phase falls
    reversal    reversal that the wire is making, or None while the wire follows the reference
    source      state of the selection of the displacement's source
    target      last feedforward, with its filtered temperature; None before the first
    """

    prediction: Prediction
    power_w: float
    trim_mm: float
    direction: int
    reversal: Reversal | None
    source: SourceState
    target: Feedforward | None = None


class _Period(NamedTuple):
    """The coming period, which begins at `time_s`.

    `ahead` is the estimate at this time, `ohm` the resistance, `least_w` and `limit_w` the least and the largest power.
    The setpoint is `setpoint_mm` and moves at `rate_mm_per_s`.
    """

    time_s: float
    ahead: WireEstimate
    ohm: float
    least_w: float
    limit_w: float
    setpoint_mm: float
    rate_mm_per_s: float


class TrackingController:
    """Makes one wire follow one displacement reference.

    A change of the reference, the wire or the settings needs a new controller, which takes over the state of the old
    controller.
    """

    def __init__(
        self,
        reference: Reference,
        wire: WireModel,
        inverse: DisplacementInverse,
        settings: TrackingSettings,
    ) -> None:
        self.duration_s = reference.duration_s
        self._reference = reference
        self._wire = wire
        self._limit_a, self._period_s = settings.current_limit_a, settings.period_s
        period_s, stroke_mm = settings.period_s, abs(wire.travel_mm)
        noise_mm = DISPLACEMENT_NOISE * stroke_mm
        self._observer = WireObserver(wire, period_s, wire.balance.assumed_noise_c(settings.noise_c), noise_mm)
        resistance = None if wire.resistance is None else ResistanceSensor(wire, wire.resistance, period_s)
        source, fresh_s = settings.displacement_from, wire.balance.fresh_s(period_s)
        self._sources = SourceSelection(source, resistance, noise_mm, stroke_mm, period_s, fresh_s)
        self._feedforward = DisplacementFeedforward(inverse, wire)
        self._preview = ReversalPreview(wire, period_s) if inverse.hysteretic else None
        self._filter = SetpointFilter(wire) if inverse.hysteretic else None
        self._feedback = TrackingFeedback(wire, settings)
        self._trim = DisplacementTrim(settings.closed_loop_s, stroke_mm, hysteretic=inverse.hysteretic)
        self._state: TrackingState | None = None

    @property
    def state(self) -> TrackingState | None:
        """The state after the last update; None before the first update."""
        return self._state

    def trusts_sensor(self) -> bool:
        """Return False while the displacement sensor gives wrong readings."""
        return self._state is None or not self._state.source.compared.is_sensor_wrong

    def take_over(self, before: TrackingController) -> None:
        """Continue from the state of the controller `before`; the command jumps only if the error is large.

        The state is converted to the model of this controller. A reversal that `before` has begun continues only if
        both controllers have the same reference.
        """
        if before.state is not None:
            reversal = before.state.reversal if before._reference is self._reference else None
            last, ahead, span_s = before.state.prediction
            estimate = self._observer.adopt(last, before._observer)
            prediction = Prediction(estimate, self._observer.adopt(ahead, before._observer), span_s)
            source = self._sources.adopt(before.state.source, before._sources)
            self._state = before.state._replace(prediction=prediction, reversal=reversal, source=source)
            self._feedback.take_over(before._feedback, estimate.temperature_c)

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Return the command for the period that begins with the next measurement. `dt_s` is the time since the last.

        The current is zero until the first reading of the temperature.
        """
        if self._state is None and not isfinite(measurement.temperature_c):
            return Command(0.0, setpoint_mm=self._reference.value_mm(time_s))
        before = self._state or self._started(measurement)
        source, selected = self._sources.update(before.source, measurement, before.prediction, dt_s)
        by_sensor = source.source is DisplacementFrom.SENSOR
        estimate = self._observed(measurement, selected.used, dt_s, by_sensor=by_sensor)
        coming_s = max(dt_s, self._period_s)  # on a slow bus, a short period is followed by a long one
        ahead = self._observer.predict(estimate, before.power_w, coming_s)
        period = self._coming_period(ahead, source, time_s + coming_s, coming_s)
        direction, reversal = self._course(before, period)
        is_measured = isfinite(selected.used.mm)
        target = self._target(period, before, direction, reversal)
        if is_measured:
            target = self._filtered(target, before.target, ahead, direction, dt_s)
        is_held_back = bool(measurement.limits)
        requested_w = self._feedback.update(
            target, ahead, period.limit_w, coming_s, is_measured=is_measured, is_held_back=is_held_back
        )
        power_w = max(requested_w, period.least_w)
        trim_mm = 0.0
        if reversal is None and is_measured:
            is_free = target.reachable and not is_held_back and period.least_w < requested_w < period.limit_w
            error_mm = period.setpoint_mm - period.ahead.hysteresis.y
            error_c = target.temperature_c - period.ahead.temperature_c
            trim_mm = self._trim.update(before.trim_mm, error_mm, error_c if is_free else inf, coming_s)
        elif reversal is None:
            trim_mm = self._trim.forgotten(before.trim_mm, coming_s)
        prediction = Prediction(estimate, ahead, coming_s)
        self._state = TrackingState(prediction, power_w, trim_mm, direction, reversal, source, target)
        return Command(
            sqrt(power_w / period.ohm),
            target.temperature_c,
            self._reference.value_mm(time_s),
            estimate.temperature_c,
            estimate.hysteresis.y,
            power_w,
            self._observer.cooling(estimate),
            estimate.shift_c,
            selected.by_resistance.mm,
            selected.by_resistance.noise_mm,
            uses_resistance=float(source.needs_resistance),
            sensor_replaced=float(source.is_replaced),
            resistance_wrong=float(source.compared.is_resistance_wrong),
        )

    def _started(self, measurement: Measurement) -> TrackingState:
        """Return the state of a wire at rest."""
        estimate = self._observer.start(measurement.temperature_c, self._sources.start_mm(measurement))
        prediction = Prediction(estimate, estimate, self._period_s)
        return TrackingState(prediction, 0.0, 0.0, 1, None, self._sources.start())

    def _observed(
        self, measurement: Measurement, displacement: DisplacementReading, dt_s: float, *, by_sensor: bool
    ) -> WireEstimate:
        """Return the estimate at `measurement`."""
        if self._state is None:
            return self._observer.start(measurement.temperature_c, self._sources.start_mm(measurement))
        before = self._state.prediction.before
        return self._observer.update(
            before,
            measurement.temperature_c,
            displacement.mm,
            heating_w(measurement, self._wire, before, self._limit_a),
            dt_s,
            displacement.noise_mm,
            by_sensor=by_sensor,
            is_new=displacement.is_new,
        )

    def _coming_period(self, ahead: WireEstimate, source: SourceState, time_s: float, dt_s: float) -> _Period:
        """Return the period that begins at `time_s`, with the estimate `ahead` at this time."""
        ohm = self._wire.resistance_ohm(ahead.hysteresis, ahead.temperature_c)
        setpoint_mm = self._reference.value_mm(time_s)
        rate_mm_per_s = (self._reference.value_mm(time_s + dt_s) - setpoint_mm) / dt_s
        least_a, most_a = self._sources.floor_a(source), min(self._sources.most_a(source), self._limit_a)
        return _Period(time_s, ahead, ohm, least_a**2 * ohm, most_a**2 * ohm, setpoint_mm, rate_mm_per_s)

    def _course(self, before: TrackingState, period: _Period) -> tuple[int, Reversal | None]:
        """Return the direction of the phase, and the reversal that the wire continues or begins (None: no reversal)."""
        travel_mm, reversal = self._wire.travel_mm, before.reversal
        if reversal is not None and not reversal.is_over(period.time_s, period.ahead.hysteresis, travel_mm):
            return before.direction, reversal
        direction = before.direction
        if period.rate_mm_per_s:
            direction = 1 if period.rate_mm_per_s / travel_mm > 0 else -1
        if self._preview is None:
            return direction, None
        limits_w = (period.least_w, period.limit_w)
        reversal = self._preview.update(period.ahead, self._reference, period.time_s, direction, limits_w)
        return (direction, None) if reversal is None else (reversal.direction, reversal)

    def _target(self, period: _Period, before: TrackingState, direction: int, reversal: Reversal | None) -> Feedforward:
        """Return temperature and power of the feedforward: for the setpoint, or for the meeting point of a reversal."""
        if reversal is not None:
            return self._feedforward.hold(period.ahead, reversal.meets_c, reversal.meets_mm)
        setpoint_mm, rate_mm_per_s = period.setpoint_mm + before.trim_mm, period.rate_mm_per_s
        turns_back = before.target is not None and before.target.turns_back
        return self._feedforward.update(period.ahead, setpoint_mm, rate_mm_per_s, direction, turns_back=turns_back)

    def _filtered(
        self, target: Feedforward, last: Feedforward | None, ahead: WireEstimate, direction: int, dt_s: float
    ) -> Feedforward:
        """Return `target` with a filtered temperature. `last` is the target of the last command, `dt_s` before."""
        if self._filter is None or last is None:
            return target
        setpoint_c = self._filter.update(last.temperature_c, target.temperature_c, ahead, direction, dt_s)
        return target._replace(temperature_c=setpoint_c)
