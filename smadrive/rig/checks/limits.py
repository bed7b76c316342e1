"""Checks of a rig file against its wire, before anything is heated.

**Limits.** Each limit must be plausible for this wire. An implausible limit often has a wrong unit.

The temperature limit must not exceed the limit of the wire file. The current limit is compared with the current that
holds a wire of resistance R at `temperature_max_c` (T_max) in surroundings of T_amb; h A is its heat loss in W/K:

    I_held = sqrt(h A (T_max - T_amb) / R)

A current limit of more than `AMPLE` times this current protects nothing. A current limit that warms the wire by less
than `LEAST_WARMING_K` is lost in the noise of the measured current.

When a clamp opens, the voltage of a supply rises to the voltage limit. So this limit should be only a little above
R I_max, with I_max the current limit. If a supply gives less than `LEAST_SHARE` of the commanded current, the
supervisor assumes a broken circuit. So the voltage limit must at least allow this share. The upper bound is
`MOST_VOLTS` (R + R_leads) max(I_max, I_held). It contains the resistance of the leads, and I_held for a current limit
that is still low for the first heating.

**Heat balance.** An identified heat balance must be near the nominal heat balance of the rig's wire, because all
supervision of a run relies on it. If the thermocouple lag stood in milliseconds instead of seconds, the supervisor
would find no reading implausible. If the resistance were ten times too large, the wire would not be heated. The ranges
allow for the scatter of correct values: published specific heats differ by a factor of 2.6, moving air doubles the
loss, and a bead of glue makes a thermocouple several times slower.
"""

from __future__ import annotations

from math import isnan

from smadrive.control.controllers.step import ManualStep
from smadrive.devices.heater import DERATE_C
from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig, kelvin_hint
from smadrive.rig.controllers import excitation_path
from smadrive.safety.safety_limits import LEAST_SHARE
from smadrive.wire.data_sheet import LEADS_OHM, WireDataSheet
from smadrive.wire.heat_balance import HeatBalance

AMPLE = 20.0
"""Highest current limit, as a multiple of the current that holds the wire at temperature_max_c."""

LEAST_WARMING_K = 1.0
"""Lowest current limit: the current that holds the wire this much above ambient_c."""

MOST_VOLTS = 4.0
"""Highest voltage limit, as a multiple of (R + R_leads) max(I_max, I_held); see the head of this file."""

FACTORS = {"heat_capacity_j_per_k": 3.0, "loss_w_per_k": 3.0, "resistance_cold_ohm": 2.0}
"""Largest factor, up or down, between an identified parameter and its nominal value."""
LATENT_FACTOR, LATENT_SPAN_K = 5.0, 20.0
"""Largest latent heat: nominal latent heat times factor, or nominal heat capacity times span if this is larger."""
LAG_FACTOR, LAG_S = 5.0, 1.0
"""Largest lag: its nominal value times the factor, or the time in seconds if that is longer."""
AMBIENT_K = 20.0
"""Largest difference between identified and nominal ambient temperature in K."""
RESISTANCE_CHANGE = 0.4
"""Largest difference between identified and nominal `resistance_change`, which may be positive or negative."""


def check_limits(config: RigConfig, wire: WireDataSheet) -> None:
    """Raise ConfigError if a limit of the rig is implausible for this wire."""
    _check_temperature(config, wire)
    balance = wire.heat_balance()
    held_a = balance.current_a(balance.power_w(config.limits.temperature_max_c, 0.0, 0.0), 1.0)
    least_a = balance.current_a(balance.power_w(wire.ambient_c + LEAST_WARMING_K, 0.0, 0.0), 0.0)
    _check_current(config, held_a, least_a)
    _check_voltage(config, balance, held_a)


def _check_temperature(config: RigConfig, wire: WireDataSheet) -> None:
    limit_c, wire_c = config.limits.temperature_max_c, wire.temperature_max_c
    if limit_c <= wire.ambient_c:
        raise ConfigError(
            f"limits.temperature_max_c is not above ambient_c of '{config.wire}', so nothing could be heated",
            where=f"rig '{config.name}'",
            value=f"{limit_c:g} °C",
            limit=f"{wire.ambient_c:g} °C",
            cure="raise limits.temperature_max_c in the rig file, or lower ambient_c in the wire file",
        )
    if limit_c > wire_c:
        raise ConfigError(
            f"limits.temperature_max_c is more than '{config.wire}' withstands",
            where=f"rig '{config.name}'",
            value=f"{limit_c:g} °C",
            limit=f"{wire_c:g} °C",
            cure=_temperature_cure(limit_c, wire),
        )


def _temperature_cure(limit_c: float, wire: WireDataSheet) -> str:
    """Return the cure for a limit above the highest temperature of the wire, by default `AGEING_C`."""
    cure = "lower it"
    if "temperature_max_c" not in wire.model_fields_set:
        cure = (
            "the wire file has no temperature_max_c, and nickel-titanium ages above this limit: lower it, or set "
            "temperature_max_c in the wire file if the alloy withstands more"
        )
    return cure + kelvin_hint(limit_c, wire.ambient_c, wire.temperature_max_c)


def _check_current(config: RigConfig, held_a: float, least_a: float) -> None:
    limit_a = config.limits.current_max_a
    if limit_a < least_a:
        raise ConfigError(
            f"limits.current_max_a is too small to warm '{config.wire}' by {LEAST_WARMING_K:g} K",
            where=f"rig '{config.name}'",
            value=f"{limit_a:g} A",
            limit=f"at least {least_a:.2g} A",
            cure="raise limits.current_max_a to a current that the data sheet of the wire allows. Is it in amperes?",
        )
    if limit_a > AMPLE * held_a:
        raise ConfigError(
            f"limits.current_max_a is far above the {held_a:.2g} A that hold '{config.wire}' at temperature_max_c",
            where=f"rig '{config.name}'",
            value=f"{limit_a:g} A",
            limit=f"{AMPLE * held_a:.2g} A",
            cure="lower limits.current_max_a. Is the limit in amperes?",
        )


def _check_voltage(config: RigConfig, balance: HeatBalance, held_a: float) -> None:
    limits = config.limits
    if limits.voltage_max_v is None:
        return
    ends_ohm = balance.resistance_ohm(0.0), balance.resistance_ohm(1.0)
    needed_v = max(ends_ohm) * limits.current_max_a
    least_v = LEAST_SHARE * min(ends_ohm) * limits.current_max_a
    most_v = MOST_VOLTS * (max(ends_ohm) + LEADS_OHM) * max(limits.current_max_a, held_a)
    if not least_v <= limits.voltage_max_v <= most_v:
        wrong = "too low to drive" if limits.voltage_max_v < least_v else "far above what is needed to drive"
        raise ConfigError(
            f"limits.voltage_max_v is {wrong} current_max_a through '{config.wire}': this takes {needed_v:.2g} V",
            where=f"rig '{config.name}'",
            value=f"{limits.voltage_max_v:g} V",
            limit=f"{least_v:.2g} to {most_v:.2g} V",
            cure=f"set voltage_max_v to about {1.25 * needed_v:.2g} V. Is the limit in volts?",
        )


def check_excitation_time(config: RigConfig, wire: WireDataSheet) -> None:
    """Raise ConfigError if the identification experiment of a cold wire does not fit into its `duration_s`."""
    if config.excitation.duration_s is not None:
        excitation_path(config.excitation, wire.ambient_c)


def check_step(step: ManualStep, config: RigConfig, wire: WireDataSheet) -> tuple[str, ...]:
    """Raise ConfigError if a manual step exceeds a limit of the rig. Return warnings, one sentence each."""
    if step.current_a is not None:
        return _check_current_step(step.current_a, step.duration_s, config, wire.heat_balance())
    assert step.temperature_c is not None
    return _check_temperature_step(step.temperature_c, config, wire.heat_balance())


def derating_caveats(hottest_c: float, temperature_max_c: float) -> tuple[str, ...]:
    """Return a caveat if the driver lowers the current of a wire at the temperature `hottest_c` of a reference, °C."""
    if hottest_c <= temperature_max_c - DERATE_C:
        return ()
    near = f"the reference needs {hottest_c:.0f} °C, less than {DERATE_C:g} K below temperature_max_c"
    return (f"{near}, where the driver lowers the current: its hot end may be out of reach",)


def _check_current_step(
    current_a: float, duration_s: float, config: RigConfig, balance: HeatBalance
) -> tuple[str, ...]:
    limits = config.limits
    if not 0.0 < current_a <= limits.current_max_a:
        raise ConfigError(
            "not a number" if isnan(current_a) else f"not a current that rig '{config.name}' may heat with",
            where="step: current",
            value=f"{current_a:g} A",
            limit=f"above 0 A, at most current_max_a = {limits.current_max_a:g} A",
            cure="choose a current within these limits",
        )
    power_w = current_a**2 * balance.resistance_cold_ohm
    reaches_c = balance.step(balance.ambient_c, power_w, 0.0, duration_s)
    if reaches_c < limits.temperature_max_c - DERATE_C:
        return ()
    held_back = f"{DERATE_C:g} K below temperature_max_c = {limits.temperature_max_c:g} °C"
    reached = f"by the wire file, the wire would reach {reaches_c:.0f} °C"
    return (f"{reached}: the driver lowers the current from {held_back} on, or trips",)


def _check_temperature_step(temperature_c: float, config: RigConfig, balance: HeatBalance) -> tuple[str, ...]:
    limits = config.limits
    most_c = limits.temperature_max_c - DERATE_C
    if not temperature_c <= most_c:
        hot = (
            f"too hot for rig '{config.name}', because the driver lowers the current of a wire that is less than "
            f"{DERATE_C:g} K below temperature_max_c = {limits.temperature_max_c:g} °C"
        )
        cure = "choose a lower temperature, or raise temperature_max_c if the data sheet of the wire allows it"
        hint = kelvin_hint(temperature_c, balance.ambient_c, most_c)
        raise ConfigError(
            "not a number" if isnan(temperature_c) else hot,
            where="step: temperature",
            value=f"{temperature_c:g} °C",
            limit=f"{most_c:g} °C",
            cure="choose a temperature below this limit" if isnan(temperature_c) else cure + hint,
        )
    if not temperature_c > balance.ambient_c:
        raise ConfigError(
            "not above the ambient temperature, and a heater cannot cool",
            where="step: temperature",
            value=f"{temperature_c:g} °C",
            limit=f"ambient_c = {balance.ambient_c:g} °C",
            cure="choose a higher temperature, or correct ambient_c in the wire file",
        )
    needed_a = balance.current_a(balance.power_w(temperature_c, 0.0, 0.0), 1.0)
    if needed_a <= limits.current_max_a:
        return ()
    needed = f"by the wire file, {temperature_c:g} °C needs about {needed_a:.2f} A"
    return (f"{needed}, more than current_max_a = {limits.current_max_a:g} A: the wire may stay colder",)


def check_same_wire(found: HeatBalance, nominal: HeatBalance, wire: str) -> None:
    """Raise ConfigError if the heat balance `found` cannot belong to `wire`, whose nominal balance is `nominal`."""
    most_latent_j = max(LATENT_FACTOR * nominal.latent_heat_j, LATENT_SPAN_K * nominal.heat_capacity_j_per_k)
    ranges = {name: (getattr(nominal, name) / by, getattr(nominal, name) * by) for name, by in FACTORS.items()} | {
        "latent_heat_j": (0.0, most_latent_j),
        "thermocouple_lag_s": (0.0, max(LAG_FACTOR * nominal.thermocouple_lag_s, LAG_S)),
        "ambient_c": (nominal.ambient_c - AMBIENT_K, nominal.ambient_c + AMBIENT_K),
        "resistance_change": (
            nominal.resistance_change - RESISTANCE_CHANGE,
            nominal.resistance_change + RESISTANCE_CHANGE,
        ),
    }
    for name, (low, high) in ranges.items():
        value = getattr(found, name)
        if not low <= value <= high:
            raise ConfigError(
                f"{name} does not fit the rig's wire '{wire}', whose nominal value is {getattr(nominal, name):.4g}",
                where="heat balance of the model",
                value=f"{value:.4g}",
                limit=f"{low:.3g} to {high:.3g}",
                cure="identify this wire again, or correct the wire file",
            )
