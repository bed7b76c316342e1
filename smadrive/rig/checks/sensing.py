"""Checks, before the wire is heated, whether the rig can use the resistance of the wire.

The resistance replaces a displacement sensor, and it checks the thermocouple. For both, the device that heats must
measure current and voltage. A voltage that is computed from the current gives the same resistance at every temperature,
which looks like that of a cold wire. If the device cannot measure the resistance, the wire is used without it.

The resolution of the device limits the displacement (wire/observability.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from smadrive.devices.profile.profile import Profile
from smadrive.devices.profile.schema import Head, Roles
from smadrive.errors import ConfigError
from smadrive.files.number_text import distinct
from smadrive.measurement import DisplacementFrom
from smadrive.rig.planned_device import PlannedDevice
from smadrive.rig.supervision import WireChecks
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import TOO_COARSE, cold_c, lost_text, resolution_error, resolution_text
from smadrive.wire.wire_model import WireModel

KEY = "displacement_from"
ALONE = (
    "no device measures the displacement, so it follows from the model and the thermocouple alone: "
    f'set {KEY} = "{DisplacementFrom.RESISTANCE}" to measure it by the resistance'
)
OTHER_SOURCE = f'set {KEY} = "none", or "sensor" if the rig has a displacement sensor'


def check_sensing(
    chosen: DisplacementFrom, source: PlannedDevice, wire: WireModel, temperature_c: float, *, has_sensor: bool
) -> tuple[str, ...]:
    """Return warnings of a run that takes the displacement from `chosen`, one sentence each.

    `source` is the device that heats, `temperature_c` the present temperature of the wire. `has_sensor` is True if a
    device of the rig measures the displacement. ConfigError if the displacement cannot come from the resistance.
    """
    problem = None if wire.resistance is None else _unusable(source, wire, wire.resistance)
    if chosen is DisplacementFrom.NONE:
        return ()
    if chosen is DisplacementFrom.SENSOR:
        if problem is not None:
            return (_unused_text(problem),)
        return () if has_sensor or wire.resistance is None else (ALONE,)
    if problem is not None:
        raise problem
    if wire.resistance is None:
        raise ConfigError(
            "the model file has no resistance",
            where=KEY,
            value=f'"{chosen.value}"',
            cure="identify the wire again, from a log of `smadrive excite` with a displacement sensor; "
            "`smadrive identify` says why if the resistance cannot be used",
        )
    return *_resolution_caveats(source, wire, wire.resistance), *_lead_caveats(wire, wire.resistance, temperature_c)


def usable_wire(wire: WireModel, source: PlannedDevice) -> WireModel:
    """Return the wire, but without its resistance if `source`, the device that heats, cannot measure the resistance."""
    if wire.resistance is None or _unusable(source, wire, wire.resistance) is None:
        return wire
    return WireModel(wire.model, wire.balance)


def usable_checks(checks: WireChecks, source: PlannedDevice) -> WireChecks:
    """Return the checks of the wire without those that need a resistance that `source` cannot measure."""
    expected = checks.expected if source.measures("resistance") else None
    return checks._replace(wire=usable_wire(checks.wire, source), expected=expected)


def measures_resistance_by(profile: Mapping[str, Any]) -> bool:
    """Return True if a device with this profile, as a log holds it, heats and measures current and voltage."""
    return Head(**profile["profile"]).heats and Roles(**profile["roles"]).measure_resistance


def check_sensor(chosen: DisplacementFrom, *, is_measured: bool) -> None:
    """Raise ConfigError if the user has chosen the sensor, and no device of the rig measures the displacement."""
    if chosen is DisplacementFrom.SENSOR and not is_measured:
        raise ConfigError(
            "no device of the rig measures the displacement",
            where=KEY,
            value=chosen.value,
            cure=f'choose "{DisplacementFrom.RESISTANCE}" or "{DisplacementFrom.NONE}"',
        )


def _unusable(source: PlannedDevice, wire: WireModel, resistance: WireResistance) -> ConfigError | None:
    """Return the reason why `source` cannot measure the resistance of the wire, as an error; None if it can."""
    if not source.measures("resistance"):
        return ConfigError(
            f"'{source.config.profile}' does not measure current and voltage, so the resistance is unknown",
            where=source.where,
            cure=OTHER_SOURCE,
        )
    error = resolution_error(wire, resistance, *resolution(source.profile))
    if error <= TOO_COARSE:
        return None
    return ConfigError(
        "current and voltage are measured too coarsely for the displacement by the resistance",
        where=source.where,
        value=f"up to {distinct(100 * error, 100 * TOO_COARSE)} % of the stroke by its resolution",
        limit=f"{distinct(100 * TOO_COARSE, 100 * error)} %",
        cure=f"{OTHER_SOURCE}, or use a device with a finer resolution",
    )


def _unused_text(problem: ConfigError) -> str:
    facts = "" if problem.value is None else f" ({problem.value}, limit {problem.limit})"
    return f"the resistance in the model file is not used: {problem.what}{facts}"


def resolution(profile: Profile) -> tuple[float, float]:
    """Return the quanta of the measured current, A, and of the measured voltage, V. The quantum of a float is 0."""
    names = profile.roles.measured_current, profile.roles.measured_voltage
    registers = [profile.register(name) for name in names if name is not None]
    current_a, voltage_v = (0.0 if one.type.startswith("float") else abs(one.scale) for one in registers)
    return current_a, voltage_v


def _resolution_caveats(source: PlannedDevice, wire: WireModel, resistance: WireResistance) -> tuple[str, ...]:
    return resolution_text(source.where, resolution_error(wire, resistance, *resolution(source.profile)))


def _lead_caveats(wire: WireModel, resistance: WireResistance, temperature_c: float) -> tuple[str, ...]:
    """Return warnings: where the resistance does not show the displacement, and if the leads cannot be measured."""
    texts = lost_text(wire, resistance)
    if temperature_c < cold_c(wire, resistance):
        return texts
    warm = f"the wire is at {temperature_c:.0f} °C, not cold, so a change of leads and contacts cannot be measured"
    return *texts, f"{warm}: let it cool down first"
