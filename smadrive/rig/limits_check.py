"""The limits of a rig against what its wire stands: each must be a limit for this wire, and in the unit of its name.

Temperature: no more than the wire file allows. Current: what holds the wire at `temperature_max_c`,

    I_held = sqrt(h A (T_max - T_amb) / R)

tells how much it takes; a limit of `AMPLE` times as much limits nothing. Voltage: the limit is where a supply goes when
a clamp opens, so it should lie little above R I_max. A supply that gives less than `LEAST_SHARE` of a commanded current
is taken for a broken circuit by the supervisor: a lower voltage would trip it. Above, the leads and a current limit
that is still set low for the first heat are allowed for: V <= `MOST_VOLTS` (R + R_leads) max(I_max, I_held).
"""

from __future__ import annotations

from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig
from smadrive.wire.data_sheet import WireDataSheet
from smadrive.wire.heat_balance import HeatBalance

AMPLE = 20.0
"""A limit of so many times the current that holds the wire at temperature_max_c is taken for one in another unit."""

LEAST_SHARE = 0.5
"""Of current_max_a, through the nominal wire: less is a fault as soon as current_max_a is commanded."""

MOST_VOLTS = 4.0
"""So many times the voltage that the circuit needs at its largest current are no limit any more."""

LEADS_OHM = 0.5
"""Leads and clamps: they matter beside a short thick wire."""

ZERO_C_IN_K = 273.15


def check_limits(config: RigConfig, wire: WireDataSheet) -> None:
    """ConfigError with value, limit and cure when a limit of the rig cannot be meant for this wire."""
    _check_temperature(config, wire)
    balance = wire.heat_balance()
    held_a = balance.current_a(balance.power_w(config.limits.temperature_max_c, 0.0, 0.0), 1.0)
    _check_current(config, held_a)
    _check_voltage(config, balance, held_a)


def _check_temperature(config: RigConfig, wire: WireDataSheet) -> None:
    limit_c, stands_c = config.limits.temperature_max_c, wire.temperature_max_c
    if limit_c <= wire.ambient_c:
        raise ConfigError(
            f"rig '{config.name}': limits.temperature_max_c = {limit_c:g} °C is not above ambient_c = "
            f"{wire.ambient_c:g} °C of '{config.wire}': nothing could be heated: correct the one that is wrong"
        )
    if limit_c > stands_c:
        meant_c = limit_c - ZERO_C_IN_K
        kelvin = (
            f" Is it in kelvin? {limit_c:g} K are {meant_c:.0f} °C." if wire.ambient_c < meant_c <= stands_c else ""
        )
        if "temperature_max_c" in wire.model_fields_set:
            known, cure = "by temperature_max_c of its wire file", "lower it"
        else:
            known = "where nickel-titanium begins to age, as its wire file tells no temperature_max_c"
            cure = "lower it, or set temperature_max_c in the wire file if its alloy stands more"
        raise ConfigError(
            f"rig '{config.name}': limits.temperature_max_c = {limit_c:g} °C is more than '{config.wire}' stands, "
            f"{stands_c:g} °C {known}: {cure}.{kelvin}"
        )


def _check_current(config: RigConfig, held_a: float) -> None:
    limits = config.limits
    if limits.current_max_a > AMPLE * held_a:
        raise ConfigError(
            f"rig '{config.name}': limits.current_max_a = {limits.current_max_a:g} is no limit for '{config.wire}', "
            f"which {held_a:.2g} A hold at temperature_max_c = {limits.temperature_max_c:g}: is it in amperes?"
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
        wrong = "too little to drive" if limits.voltage_max_v < least_v else "no limit for"
        raise ConfigError(
            f"rig '{config.name}': limits.voltage_max_v = {limits.voltage_max_v:g} is {wrong} current_max_a = "
            f"{limits.current_max_a:g} through '{config.wire}', which takes {needed_v:.2g} V; allowed are "
            f"{least_v:.2g} to {most_v:.2g} V: set it to some {1.25 * needed_v:.2g}; is it in volts?"
        )
