"""The checks of a measurement before the wire is heated."""

from __future__ import annotations

from math import isfinite

from smadrive.errors import SafetyError
from smadrive.measurement import Measurement
from smadrive.safety.faults import CLEAR, Contradiction, Fault
from smadrive.safety.safety_limits import SafetyLimits

REFUSED = "refused to arm"
"""The beginning of every message which says that heating must not begin."""


def check_may_arm(measurement: Measurement, limits: SafetyLimits, contradiction: Contradiction | None) -> None:
    """Raise SafetyError when heating must not begin.

    The reasons: a latched fault of the device, a temperature that is invalid or outside its limits, a current that is
    unknown or flows without a command, a displacement that has limits and is unknown, a `contradiction` between
    temperature and displacement.
    """
    if measurement.device_faults:
        latched = ", ".join(measurement.device_faults)
        raise SafetyError(f"{REFUSED}: faults are latched on the device: {latched}", cure=CLEAR)
    check_thermocouple(measurement)
    _check_temperature(measurement.temperature_c, limits)
    _check_current(measurement, limits)
    _check_displacement(measurement.displacement_mm, limits)
    if contradiction is not None:
        raise SafetyError(f"{REFUSED}: {contradiction.detail}", cure=contradiction.fault.remedy)


def check_thermocouple(measurement: Measurement) -> None:
    """Raise SafetyError when the temperature of the wire is unknown."""
    if measurement.temperature_fault or not isfinite(measurement.temperature_c):
        fault, reason = Fault.SENSOR_INVALID, measurement.temperature_fault or "no reading"
        raise SafetyError(f"{REFUSED}: {fault.cause}", value=reason, cure=fault.remedy)


def check_cooled(measurement: Measurement, least_c: float) -> None:
    """Raise SafetyError when the thermocouple reads less than `least_c`, °C, which the heat of the last run allows."""
    if measurement.temperature_c < least_c:
        raise SafetyError(
            f"{REFUSED}: {Fault.READS_TOO_COLD.cause}; the last run has heated the wire",
            value=f"{measurement.temperature_c:.1f} °C",
            limit=f"{least_c:.1f} °C",
            cure=f"let the wire cool; {Fault.READS_TOO_COLD.remedy}",
        )


def _check_temperature(temperature_c: float, limits: SafetyLimits) -> None:
    if temperature_c > limits.temperature_max_c:
        raise _too_far(Fault.OVER_TEMPERATURE, temperature_c, "temperature_max_c", limits.temperature_max_c)
    if temperature_c < limits.temperature_min_c:
        raise _too_far(Fault.UNDER_TEMPERATURE, temperature_c, "temperature_min_c", limits.temperature_min_c)


def _check_current(measurement: Measurement, limits: SafetyLimits) -> None:
    if not isfinite(measurement.current_a):
        fault, reason = Fault.POWER_UNKNOWN, measurement.supply_fault or "no reading of the current"
        raise SafetyError(f"{REFUSED}: {fault.cause}", value=reason, cure=fault.remedy)
    if abs(measurement.current_a) > limits.current_tolerance_a:
        what, cure = f"{REFUSED}: current flows although no current was commanded", Fault.UNEXPECTED_HEATING.remedy
        raise SafetyError(what, value=f"{measurement.current_a:.3f} A", cure=cure)


def _check_displacement(displacement_mm: float, limits: SafetyLimits) -> None:
    if limits.has_displacement and not isfinite(displacement_mm):
        fault = Fault.DISPLACEMENT_UNKNOWN
        cure = f"{fault.remedy}; remove the displacement limits of a rig without a displacement sensor"
        raise SafetyError(f"{REFUSED}: {fault.cause}", value="no reading", cure=cure)


def _too_far(fault: Fault, temperature_c: float, key: str, limit_c: float) -> SafetyError:
    value, limit = f"{temperature_c:.1f} °C", f"{key} = {limit_c:g} °C"
    return SafetyError(f"{REFUSED}: {fault.cause}", value=value, limit=limit, cure=fault.remedy)
