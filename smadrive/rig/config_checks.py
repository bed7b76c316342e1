"""Checks of a rig against its wire, before anything is heated.

**Limits**: each must be a limit for this wire, in the unit of its name.

Temperature: at most the limit of the wire file. Current: the current that holds the wire at `temperature_max_c`,

    I_held = sqrt(h A (T_max - T_amb) / R)

is the scale; `AMPLE` times as much limits nothing. Voltage: a supply goes to its voltage limit when a clamp opens, so
the limit should be little above R I_max. The supervisor takes a supply that gives less than `LEAST_SHARE` of the
commanded current for a broken circuit, so a lower voltage would trip it. The upper bound allows for the leads, and for
a current limit that is still low for the first heating: V <= `MOST_VOLTS` (R + R_leads) max(I_max, I_held).

**Heat balance**: an identified one must lie near the nominal one of the rig's wire, because all that supervises a run
relies on it: with a thermocouple lag in milliseconds instead of seconds no reading would be implausible, and with ten
times the resistance nothing would be heated. The ranges allow for the differences of right values: published specific
heats differ by a factor of 2.6, moving air doubles the loss, a bead of glue makes a thermocouple several times slower.
"""

from __future__ import annotations

from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig
from smadrive.wire.data_sheet import WireDataSheet
from smadrive.wire.heat_balance import HeatBalance

AMPLE = 20.0
"""A limit of this many times the current that holds the wire at temperature_max_c must be in another unit."""

LEAST_SHARE = 0.5
"""The least voltage drives this share of current_max_a through the nominal wire; less would be a fault."""

MOST_VOLTS = 4.0
"""The largest voltage, in multiples of the voltage that the circuit needs at its largest current."""

LEADS_OHM = 0.5
"""Resistance of leads and clamps: it matters beside a short thick wire."""

ZERO_C_IN_K = 273.15

FACTORS = {"heat_capacity_j_per_k": 3.0, "loss_w_per_k": 3.0, "resistance_cold_ohm": 2.0}
"""An identified parameter may differ from the nominal one by this factor, up or down."""
LATENT_FACTOR, LATENT_SPAN_K = 5.0, 20.0
"""The most latent heat: a multiple of the nominal one, or the heat capacity times a span, whichever is more."""
LAG_FACTOR, LAG_S = 5.0, 1.0
"""The longest lag: a multiple of the nominal one, or a fixed time, whichever is longer."""
AMBIENT_K = 20.0
"""Largest difference of the ambient temperature."""
RESISTANCE_CHANGE = 0.4
"""Largest difference of the relative change of resistance, whose sign differs between wires."""


def check_limits(config: RigConfig, wire: WireDataSheet) -> None:
    """ConfigError with value, limit and cure when a limit of the rig cannot be meant for this wire."""
    _check_temperature(config, wire)
    balance = wire.heat_balance()
    held_a = balance.current_a(balance.power_w(config.limits.temperature_max_c, 0.0, 0.0), 1.0)
    _check_current(config, held_a)
    _check_voltage(config, balance, held_a)


def _check_temperature(config: RigConfig, wire: WireDataSheet) -> None:
    limit_c, wire_c = config.limits.temperature_max_c, wire.temperature_max_c
    if limit_c <= wire.ambient_c:
        raise ConfigError(
            f"limits.temperature_max_c is not above ambient_c of '{config.wire}', so nothing could be heated",
            where=f"rig '{config.name}'",
            value=f"{limit_c:g} °C",
            limit=f"{wire.ambient_c:g} °C",
            cure="correct the one that is wrong",
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
    """How to correct a limit above the wire's, which is that of the wire file or that of nickel-titanium."""
    cure = "lower it"
    if "temperature_max_c" not in wire.model_fields_set:
        cure = (
            "the wire file has no temperature_max_c, and nickel-titanium ages above that limit: lower it, or set "
            "temperature_max_c in the wire file if its alloy withstands more"
        )
    from_kelvin_c = limit_c - ZERO_C_IN_K
    if wire.ambient_c < from_kelvin_c <= wire.temperature_max_c:
        cure += f". Is it in kelvin? {limit_c:g} K are {from_kelvin_c:.0f} °C"
    return cure


def _check_current(config: RigConfig, held_a: float) -> None:
    limit_a = config.limits.current_max_a
    if limit_a > AMPLE * held_a:
        raise ConfigError(
            f"limits.current_max_a is far above the {held_a:.2g} A that hold '{config.wire}' at temperature_max_c",
            where=f"rig '{config.name}'",
            value=f"{limit_a:g} A",
            limit=f"{AMPLE * held_a:.2g} A",
            cure="is it in amperes?",
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
            f"limits.voltage_max_v is {wrong} current_max_a through '{config.wire}', which takes {needed_v:.2g} V",
            where=f"rig '{config.name}'",
            value=f"{limits.voltage_max_v:g} V",
            limit=f"{least_v:.2g} to {most_v:.2g} V",
            cure=f"set it to about {1.25 * needed_v:.2g}. Is it in volts?",
        )


def check_same_wire(found: HeatBalance, nominal: HeatBalance, wire: str) -> None:
    """ConfigError when `found` cannot be a heat balance of the wire file `wire`, whose nominal one is `nominal`."""
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
                f"{name} is not that of the rig's wire '{wire}', nominally {getattr(nominal, name):.4g}",
                where="heat balance of the model",
                value=f"{value:.4g}",
                limit=f"{low:.3g} to {high:.3g}",
                cure="identify this wire again, or correct the wire file",
            )
