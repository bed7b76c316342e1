"""The two controllers that a loop can run: a temperature path (excitation) and a displacement reference (tracking).

Both end in a power and share how it becomes a current. What they believed at each tick is returned beside the current,
so that it can be recorded and looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nan
from typing import Protocol

from smadrive.control.feedback import PIGains, TemperatureFeedback
from smadrive.control.feedforward import DisplacementFeedforward
from smadrive.control.observer import WireEstimate, WireObserver
from smadrive.control.reference import Reference
from smadrive.measurement import Measurement
from smadrive.thermal import HeatBalance


@dataclass(frozen=True, slots=True)
class Command:
    """The heater current asked for, and why: setpoints, estimates and power (NaN where a controller has none)."""

    current_a: float
    wanted_c: float = nan
    wanted_mm: float = nan
    estimated_c: float = nan
    estimated_mm: float = nan
    power_w: float = nan


class Controller(Protocol):
    """One current per measurement; `time_s` counts from the start of the loop."""

    duration_s: float

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """The command for the coming period of `dt_s`."""
        ...


class TemperatureController:
    """Follows a temperature path with the nominal heat balance: the excitation, before anything is identified.

    The thermocouple is taken as the wire's temperature; what its lag distorts is put right by the identification.
    """

    def __init__(
        self,
        path_c: Callable[[float], float],
        duration_s: float,
        balance: HeatBalance,
        gains: PIGains,
        current_limit_a: float,
    ) -> None:
        self.duration_s = duration_s
        self._path_c = path_c
        self._balance = balance
        self._feedback = TemperatureFeedback(gains)
        self._current_limit_a = current_limit_a
        self._last_reading_c = nan

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """The command that takes the wire to the path's temperature one period ahead."""
        wanted_c = self._path_c(time_s + dt_s)
        rate_c_per_s = (wanted_c - self._path_c(time_s)) / dt_s
        reading_c = self._reading_c(measurement)
        feedforward_w = self._balance.power_w(wanted_c, rate_c_per_s, 0.0)
        limit_w = self._current_limit_a**2 * self._balance.resistance_cold_ohm
        power_w = self._feedback.update(wanted_c - reading_c, feedforward_w, limit_w, dt_s)
        return Command(self._balance.current_a(power_w, 0.0), wanted_c=wanted_c, estimated_c=reading_c, power_w=power_w)

    def _reading_c(self, measurement: Measurement) -> float:
        """The reading, or the last valid one while the supervisor makes up its mind about an invalid one."""
        if isfinite(measurement.temperature_c):
            self._last_reading_c = measurement.temperature_c
        return self._last_reading_c


class TrackingController:
    """Makes the wire follow a displacement reference: observer, feedforward, PI feedback on temperature.

    `feedforward_share` of the feedforward's power is used; less than 1 leaves more to the feedback.
    """

    def __init__(
        self,
        reference: Reference,
        observer: WireObserver,
        feedforward: DisplacementFeedforward,
        balance: HeatBalance,
        gains: PIGains,
        current_limit_a: float,
        feedforward_share: float = 1.0,
    ) -> None:
        self.duration_s = reference.duration_s
        self._reference = reference
        self._observer = observer
        self._feedforward = feedforward
        self._balance = balance
        self._feedback = TemperatureFeedback(gains)
        self._current_limit_a = current_limit_a
        self._feedforward_share = feedforward_share
        self._estimate: WireEstimate | None = None

    def take_over(self, before: TrackingController) -> None:
        """Go on where `before` stands: the same wire, and a command that does not jump."""
        if before._estimate is not None:
            self._estimate = self._observer.take_over(before._observer, before._estimate)
            self._feedforward.take_over(before._feedforward)
            self._feedback.take_over(before._feedback)

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """The command for the coming period; the reference is previewed by the one period that a command takes."""
        estimate = self._observe(measurement, dt_s)
        next_mm = self._reference.value_mm(time_s + dt_s)
        after_mm = self._reference.value_mm(time_s + 2.0 * dt_s)
        feedforward = self._feedforward.update(estimate, next_mm, after_mm, dt_s)
        resistance_ohm = self._balance.resistance_ohm(estimate.hysteresis.w)
        power_w = self._feedback.update(
            feedforward.temperature_c - estimate.temperature_c,
            self._feedforward_share * feedforward.power_w,
            self._current_limit_a**2 * resistance_ohm,
            dt_s,
        )
        return Command(
            self._balance.current_a(power_w, estimate.hysteresis.w),
            feedforward.temperature_c,
            self._reference.value_mm(time_s),
            estimate.temperature_c,
            estimate.hysteresis.y,
            power_w,
        )

    def _observe(self, measurement: Measurement, dt_s: float) -> WireEstimate:
        """Advance the estimate by the power measured over the period that ends now."""
        if self._estimate is None:
            self._estimate = self._observer.start(measurement.temperature_c, measurement.displacement_mm)
        else:
            power_w = measurement.current_a * measurement.voltage_v
            self._estimate = self._observer.update(self._estimate, measurement.temperature_c, power_w, dt_s)
        return self._estimate
