"""The supervisor: looks at every measurement, knows no controller, and can always stop it.

A fault is numbered, latched, and names its cause and remedy. Conditions that noise can fake are debounced: a fault is
raised when `needed` of the last `window` samples show it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite

from smadrive.errors import SafetyError
from smadrive.measurement import Measurement


class Fault(Enum):
    """Every fault of the host: number, cause, remedy. Numbers are stable; new faults get new ones."""

    OVER_TEMPERATURE = (1, "the wire is hotter than temperature_max_c", "let it cool; lower the reference or the limit")
    SENSOR_INVALID = (2, "the thermocouple gives no valid reading", "check the bead, the plug and the polarity")
    STALE_DATA = (3, "no fresh measurement arrived in time", "check the cable, the port and the device's supply")
    DEVICE_FAULT = (4, "the device latched a fault of its own", "see the device's fault; remove it, then clear it")
    CURRENT_MISMATCH = (5, "the measured current is not the commanded one", "check the wire's clamps and the supply")
    UNEXPECTED_HEATING = (
        6,
        "current flows although none was commanded",
        "switch the supply off: its switch is shorted",
    )

    def __init__(self, number: int, cause: str, remedy: str) -> None:
        self.number = number
        self.cause = cause
        self.remedy = remedy


@dataclass(frozen=True, slots=True)
class Trip:
    """A latched fault with the value that raised it."""

    fault: Fault
    time_s: float
    detail: str

    def __str__(self) -> str:
        """One sentence for a person."""
        return f"fault {self.fault.number}: {self.fault.cause} ({self.detail}); {self.fault.remedy}"


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """What the supervisor guards; all limits are of the rig's config."""

    temperature_max_c: float
    stale_after_s: float = 0.3
    current_tolerance_a: float = 0.05


@dataclass(slots=True)
class _Debounce:
    """True when `needed` of the last `window` samples were bad."""

    needed: int
    window: int
    _recent: deque[bool] = field(init=False)

    def __post_init__(self) -> None:
        self._recent = deque(maxlen=self.window)

    def update(self, bad: bool) -> bool:
        self._recent.append(bad)
        return sum(self._recent) >= self.needed


class Supervisor:
    """Checks each measurement and each silence; the first fault is latched as `trip`."""

    def __init__(self, limits: SafetyLimits) -> None:
        self._limits = limits
        self.trip: Trip | None = None
        self._hot = _Debounce(2, 3)
        self._invalid = _Debounce(3, 5)
        self._mismatch = _Debounce(4, 5)
        self._fresh_s: float | None = None

    def update(self, measurement: Measurement, commanded_a: float) -> Trip | None:
        """Judge one measurement taken while `commanded_a` was in force; the latched trip, if any."""
        self._fresh_s = measurement.time_s
        self._check_device(measurement)
        self._check_temperature(measurement)
        self._check_current(measurement, commanded_a)
        return self.trip

    def check_fresh(self, now_s: float) -> Trip | None:
        """Judge the silence since the last measurement; the latched trip, if any."""
        if self._fresh_s is None:
            self._fresh_s = now_s
        age_s = now_s - self._fresh_s
        if age_s > self._limits.stale_after_s:
            self._raise(
                Fault.STALE_DATA, now_s, f"{age_s:.2f} s without a measurement, limit {self._limits.stale_after_s:g} s"
            )
        return self.trip

    def check_may_arm(self, measurement: Measurement) -> None:
        """SafetyError when heating must not begin: an open fault, no valid temperature, or a wire already too hot."""
        if measurement.device_faults:
            latched = ", ".join(measurement.device_faults)
            raise SafetyError(
                f"refused to arm: latched on the device: {latched}; "
                "remove the cause, then smadrive off RIG --clear-faults"
            )
        if measurement.temperature_fault or not isfinite(measurement.temperature_c):
            reason = measurement.temperature_fault or "no reading"
            raise SafetyError(f"refused to arm: thermocouple: {reason}; {Fault.SENSOR_INVALID.remedy}")
        if measurement.temperature_c > self._limits.temperature_max_c:
            raise SafetyError(
                f"refused to arm: the wire is at {measurement.temperature_c:.1f} °C, "
                f"above temperature_max_c = {self._limits.temperature_max_c:g}; {Fault.OVER_TEMPERATURE.remedy}"
            )

    def _check_device(self, measurement: Measurement) -> None:
        if measurement.device_faults:
            self._raise(Fault.DEVICE_FAULT, measurement.time_s, ", ".join(measurement.device_faults))

    def _check_temperature(self, measurement: Measurement) -> None:
        temperature_c, limit_c = measurement.temperature_c, self._limits.temperature_max_c
        if self._invalid.update(not isfinite(temperature_c)):
            self._raise(Fault.SENSOR_INVALID, measurement.time_s, measurement.temperature_fault or "no reading")
        if self._hot.update(temperature_c > limit_c):
            self._raise(Fault.OVER_TEMPERATURE, measurement.time_s, f"{temperature_c:.1f} °C, limit {limit_c:g} °C")

    def _check_current(self, measurement: Measurement, commanded_a: float) -> None:
        excess_a = measurement.current_a - commanded_a
        limited = bool(measurement.device_limits)  # then the device gives less than asked, and says so
        too_little = -excess_a > self._limits.current_tolerance_a and not limited
        if not self._mismatch.update(excess_a > self._limits.current_tolerance_a or too_little):
            return
        fault = Fault.CURRENT_MISMATCH if commanded_a > 0 else Fault.UNEXPECTED_HEATING
        self._raise(fault, measurement.time_s, f"{measurement.current_a:.3f} A measured, {commanded_a:.3f} A commanded")

    def _raise(self, fault: Fault, time_s: float, detail: str) -> None:
        if self.trip is None:
            self.trip = Trip(fault, time_s, detail)
