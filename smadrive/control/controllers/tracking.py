"""The controller that makes a wire follow a displacement reference.

    measurement → observer → (one period on) → inverse feedforward with preview → temperature feedback → power → current

A command acts one period after the measurement that it answers. So the estimate is taken one period on, with the power
that is in force until then, and everything is computed for that moment.

What a controller has learned is a value: a new one for another reference, model or setting takes it over and goes on
without a bump, within the tick in which it is put into the old one's place.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from smadrive.control.controllers.feedback import PIGains, TemperatureFeedback
from smadrive.control.controllers.temperature import Command
from smadrive.control.controllers.trim import DisplacementTrim
from smadrive.control.estimation.observer import WireEstimate, WireObserver
from smadrive.control.feedforward.displacement import DisplacementFeedforward, DisplacementInverse
from smadrive.control.feedforward.reversal_preview import ReversalPreview, Turn
from smadrive.control.references.reference import Reference
from smadrive.measurement import Measurement
from smadrive.wire.wire_model import WireModel

DISPLACEMENT_NOISE = 0.001
"""Standard deviation of a displacement sensor, in strokes."""


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """What a controller needs besides reference and wire; its gains follow from the wire's heat balance.

    `closed_loop_s`: time constant of the temperature loop, `integral_s`: in which a model error is gone, `noise_c`:
    standard deviation of the thermocouple. `feedforward_share` of the feedforward's power is used; less than 1 leaves
    more to the feedback.
    """

    period_s: float
    current_limit_a: float
    closed_loop_s: float
    integral_s: float
    noise_c: float
    feedforward_share: float = 1.0


class TrackingState(NamedTuple):
    """What a TrackingController knows of the past, besides the integral of its feedback.

    The estimate, the power in force, the trim, the direction of the phase, the turn that the wire is in.
    """

    estimate: WireEstimate
    power_w: float
    trim_mm: float
    direction: int
    turn: Turn | None


class TrackingController:
    """The controller above for one wire and one reference; cheap to make."""

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
        self._limit_a = settings.current_limit_a
        noise_mm = DISPLACEMENT_NOISE * abs(wire.travel_mm)
        self._observer = WireObserver(wire, settings.period_s, settings.noise_c, noise_mm)
        self._feedforward = DisplacementFeedforward(inverse, wire)
        self._preview = ReversalPreview(wire) if inverse.hysteretic else None
        self._feedback = TemperatureFeedback(
            PIGains.for_balance(wire.balance, settings.closed_loop_s, settings.integral_s)
        )
        self._trim = DisplacementTrim(settings.closed_loop_s)
        self._share = settings.feedforward_share
        self._state: TrackingState | None = None

    @property
    def state(self) -> TrackingState | None:
        """What this controller knows; None before the first update."""
        return self._state

    def take_over(self, before: TrackingController) -> None:
        """Go on where `before` stands: the same wire, in the terms of this model, and a command that does not jump."""
        if before.state is not None:
            turn = before.state.turn if before._reference is self._reference else None
            self._state = before.state._replace(estimate=self._observer.adopt(before.state.estimate), turn=turn)
            self._feedback.take_over(before._feedback)

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """The command for the coming period of `dt_s`, which begins `dt_s` after the measurement."""
        before = self._state or self._started(measurement)
        estimate = self._observed(measurement, dt_s)
        ahead = self._observer.predict(estimate, before.power_w, dt_s)
        limit_w = self._limit_a**2 * self._wire.resistance_ohm(ahead.hysteresis)
        setpoint_mm, rate_mm_per_s = self._wanted(time_s + dt_s, dt_s)
        direction, turn = self._course(before, ahead, time_s + dt_s, rate_mm_per_s, limit_w)
        if turn is None:
            target = self._feedforward.update(ahead, setpoint_mm + before.trim_mm, rate_mm_per_s, direction)
        else:
            target = self._feedforward.hold(ahead, turn.meets_c)
        error_c = target.temperature_c - ahead.temperature_c
        power_w = self._feedback.update(error_c, self._share * target.power_w, limit_w, dt_s)
        trim_mm = 0.0
        if turn is None and isfinite(measurement.displacement_mm):
            free = 0.0 < power_w < limit_w
            trim_mm = self._trim.update(
                before.trim_mm, setpoint_mm - ahead.hysteresis.y, error_c if free else inf, dt_s
            )
        self._state = TrackingState(estimate, power_w, trim_mm, direction, turn)
        return Command(
            self._wire.balance.current_a(power_w, self._wire.phase(ahead.hysteresis)),
            target.temperature_c,
            self._reference.value_mm(time_s),
            estimate.temperature_c,
            estimate.hysteresis.y,
            power_w,
        )

    def _started(self, measurement: Measurement) -> TrackingState:
        """A wire at rest."""
        estimate = self._observer.start(measurement.temperature_c, measurement.displacement_mm)
        return TrackingState(estimate, 0.0, 0.0, 1, None)

    def _observed(self, measurement: Measurement, dt_s: float) -> WireEstimate:
        """The estimate advanced by the power measured over the period that ends now, the commanded one if unknown."""
        if self._state is None:
            return self._observer.start(measurement.temperature_c, measurement.displacement_mm)
        measured_w = measurement.current_a * measurement.voltage_v
        return self._observer.update(
            self._state.estimate,
            measurement.temperature_c,
            measurement.displacement_mm,
            measured_w if isfinite(measured_w) else self._state.power_w,
            dt_s,
        )

    def _wanted(self, time_s: float, dt_s: float) -> tuple[float, float]:
        """Reference and its rate over the period that begins at `time_s`."""
        setpoint_mm = self._reference.value_mm(time_s)
        return setpoint_mm, (self._reference.value_mm(time_s + dt_s) - setpoint_mm) / dt_s

    def _course(
        self, before: TrackingState, ahead: WireEstimate, time_s: float, rate_mm_per_s: float, limit_w: float
    ) -> tuple[int, Turn | None]:
        """The direction of the phase, and the turn that the wire is in or begins."""
        if before.turn is not None and not before.turn.is_over(time_s, ahead.hysteresis, self._wire.travel_mm):
            return before.direction, before.turn
        direction = before.direction
        if rate_mm_per_s:
            direction = 1 if rate_mm_per_s / self._wire.travel_mm > 0 else -1
        if self._preview is None:
            return direction, None
        turn = self._preview.update(ahead, self._reference, time_s, direction, limit_w)
        return (direction, None) if turn is None else (-direction, turn)
