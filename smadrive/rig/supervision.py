"""The supervisor of a run, created from rig file, heater, heat balance and model, and the check of the loop's rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import NamedTuple

from smadrive.clock import Clock
from smadrive.devices.heater import Heater
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.zero_current import ZERO_SHARE
from smadrive.errors import ConfigError, TransportError
from smadrive.files.number_text import distinct
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.rig.config import RigConfig
from smadrive.rig.plan import stale_after_s
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.faults import Fault
from smadrive.safety.resistance_band import ResistanceBand
from smadrive.safety.safety_limits import SafetyLimits
from smadrive.safety.supervisor import Supervisor
from smadrive.safety.temperature_band import UNCERTAINTIES, Heated, TemperatureBand
from smadrive.safety.temperature_by_resistance import TemperatureByResistance, always, by_sensor
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

LAG_FACTOR = 3.0
"""Multiple of the thermocouple's nominal lag that the supervisor allows before a reading counts as implausible."""

CONTRADICTS_S = 2.0
"""A reading that contradicts displacement or resistance is a fault after this time in s plus the allowed lag."""

SAMPLED = 0.5
"""Longest time between two temperature readings, as a fraction of the wire's time constant."""

READINGS_TO_TRIP = 2
"""A temperature above its limit trips when this number of readings show it (see the supervisor)."""

LARGEST_EXCESS_K = 60.0
"""Largest excess of the wire over temperature_max_c at a trip, K. A wire limited to 135 °C then stays below 200 °C."""

FASTER = "raise rate_hz of the rig, and of the thermometer if it has one, or use a faster thermometer"

RATE_EXCHANGES = 4
"""Number of exchanges that are timed before the loop starts, to check that the devices keep up with its rate."""

CURRENT_TOLERANCE_A = 0.05
"""Largest difference between measured and commanded current in amperes, but at most a tenth of current_max_a."""


class WireChecks(NamedTuple):
    """The checks of a run against what is known about its wire.

    wire           a displacement outside the range of its model at the measured temperature is a fault. Its resistance
                   checks the thermocouple while no sensor shows the displacement
    expected       if given, a jump of the resistance at rest away from it is a fault
    source         returns the source of the displacement. While it is RESISTANCE, the resistance checks the
                   thermocouple beside a sensor, too; while it is NONE, the resistance does not check it
    trusts_sensor  the displacement counts as not measured while this function returns False
    """

    wire: WireModel
    expected: ExpectedRest | None = None
    source: Callable[[], DisplacementFrom] = by_sensor
    trusts_sensor: Callable[[], bool] = always


def wire_checks(
    wire: WireModel,
    source: DisplacementFrom,
    expected: ExpectedRest | None = None,
    trusts_sensor: Callable[[], bool] = always,
) -> WireChecks:
    """Return the checks of a run whose displacement comes from `source`. With NONE, the resistance checks nothing."""
    checked = WireModel(wire.model, wire.balance) if source is DisplacementFrom.NONE else wire
    return WireChecks(checked, expected, lambda: source, trusts_sensor)


def supervisor(
    config: RigConfig,
    heater: Heater,
    balance: HeatBalance,
    checks: WireChecks | None = None,
    last: Heated | None = None,
) -> Supervisor:
    """Return the supervisor of a run with the limits of the rig file, and with these checks of the wire.

    `last` is the wire at the end of the last run, or None.

    ConfigError if the wire can overheat between two temperature readings.
    """
    _check_thermometer(config, heater, balance)
    lag_s = LAG_FACTOR * balance.thermocouple_lag_s
    limits = _safety_limits(config, heater.source.settle_s, lag_s, balance.fresh_s(1.0 / config.rate_hz))
    band = TemperatureBand(balance, UNCERTAINTIES[balance.source], lag_s + heater.temperature_period_s, last)
    if checks is None:
        return Supervisor(limits, band)
    wire, displacement = checks.wire, DisplacementBand(checks.wire.model)
    current_max_a, hottest_c = config.limits.current_max_a, config.limits.temperature_max_c
    at_rest = None if checks.expected is None else ResistanceBand(wire, displacement, checks.expected, current_max_a)
    by_resistance = None
    if wire.resistance is not None:
        limits_of_run = hottest_c, current_max_a, checks.source
        by_resistance = TemperatureByResistance(wire, wire.resistance, displacement, *limits_of_run)
    return Supervisor(limits, band, displacement, at_rest, by_resistance, checks.trusts_sensor)


def check_rate(config: RigConfig, heater: Heater, clock: Clock) -> None:
    """Raise ConfigError if the devices cannot keep up with the rig's rate. The current is set to zero.

    Every exchange writes, as the exchanges of a run do whose current changes. TransportError if the devices are late
    because a sensor cannot be read.
    """
    begun_s, period_s = clock.now_s(), 1.0 / config.rate_hz
    for _ in range(RATE_EXCHANGES):
        heater.source.forget_command()
        heater.exchange(0.0)
    needed_s = (clock.now_s() - begun_s) / RATE_EXCHANGES
    if needed_s > period_s:
        _check_readings(config, heater)
        raise ConfigError(
            "the devices are too slow for rate_hz",
            where=f"rig '{config.name}'",
            value=f"{distinct(needed_s, period_s)} s per tick",
            limit=f"{distinct(period_s, needed_s)} s",
            cure=f"set rate_hz to {0.8 / needed_s:.2g}",
        )


def _check_readings(config: RigConfig, heater: Heater) -> None:
    for sensor in (heater.thermometer, heater.displacement):
        if sensor is not None and sensor.failure is not None:
            where, what = f"rig '{config.name}'", f"the sensor of the {sensor.quantity} cannot be read"
            raise TransportError(what, where=where, value=str(sensor.failure), cure="check this sensor")


def unexpected_current(config: RigConfig, measurement: Measurement) -> str | None:
    """Return a warning if current flows although no current is commanded; None without such a current.

    A current that was not measured gives no warning. Use the function only while the heater is off: in a run, the
    supervisor trips.
    """
    is_off, flows = measurement.in_force_a == 0.0, abs(measurement.current_a) > _current_tolerance_a(config)
    fault = Fault.UNEXPECTED_HEATING
    return f"{fault.cause}; {fault.remedy}" if is_off and flows else None


def with_holding_current(limits: HeaterLimits, balance: HeatBalance) -> HeaterLimits:
    """Return the limits with the current that holds the wire of this heat balance at `temperature_max_c`.

    The resistance is the largest, so the wire settles at this temperature at most.
    """
    holding_w = max(balance.power_w(limits.temperature_max_c, 0.0, 0.0), 0.0)
    return replace(limits, holding_a=min(balance.current_a(holding_w, phase) for phase in (0.0, 1.0)))


def _current_tolerance_a(config: RigConfig) -> float:
    return min(CURRENT_TOLERANCE_A, ZERO_SHARE * config.limits.current_max_a)


def _safety_limits(config: RigConfig, settle_s: float, lag_s: float, fresh_s: float) -> SafetyLimits:
    limits = config.limits
    return SafetyLimits(
        limits.temperature_max_c,
        limits.temperature_min_c,
        limits.current_max_a,
        stale_after_s=stale_after_s(config),
        current_tolerance_a=_current_tolerance_a(config),
        settle_s=settle_s,
        displacement_min_mm=-inf if limits.displacement_min_mm is None else limits.displacement_min_mm,
        displacement_max_mm=inf if limits.displacement_max_mm is None else limits.displacement_max_mm,
        tracking_max_mm=limits.tracking_max_mm or inf,
        tracking_for_s=limits.tracking_for_s,
        contradicts_for_s=CONTRADICTS_S + lag_s,
        displacement_fresh_s=fresh_s,
    )


def _check_thermometer(config: RigConfig, heater: Heater, balance: HeatBalance) -> None:
    """Raise ConfigError if the wire can overheat between two temperature readings.

    The loop reads the temperature at most once per period. Until the readings that a trip needs show that the wire has
    passed its limit, current_max_a may heat it further, by `LARGEST_EXCESS_K` at most. A displacement sensor that falls
    silent delays each of these readings. If a separate thermometer falls silent, the same current flows until the first
    missing reply has been awaited (see `HeaterLimits.holding_a`).

    A heat source with a temperature limit of its own needs no reading of the loop: it compares its measurements with
    this limit itself.
    """
    if heater.has_temperature_limit:
        return
    period_s, most_s = max(heater.temperature_period_s, 1.0 / config.rate_hz), SAMPLED * balance.time_constant_s
    if period_s > most_s:
        raise ConfigError(
            f"the wire, of time constant {balance.time_constant_s:.2g} s, can overheat between two readings",
            where=f"rig '{config.name}'",
            value=f"read every {distinct(period_s, most_s)} s",
            limit=f"{distinct(most_s, period_s)} s",
            cure=FASTER,
        )
    delay_s, awaited_s = (
        0.0 if sensor is None else sensor.delay_s for sensor in (heater.displacement, heater.thermometer)
    )
    unseen_s = READINGS_TO_TRIP * (period_s + delay_s) + awaited_s
    excess_k = _excess_k(config, balance, unseen_s)
    if excess_k > LARGEST_EXCESS_K:
        raise ConfigError(
            "at current_max_a the wire exceeds temperature_max_c too far before the driver knows it",
            where=f"rig '{config.name}'",
            value=f"by {excess_k:.0f} K within {unseen_s:.3g} s",
            limit=f"{LARGEST_EXCESS_K:g} K",
            cure=f"lower current_max_a, or {FASTER}",
        )


def _excess_k(config: RigConfig, balance: HeatBalance, for_s: float) -> float:
    """Return the excess over temperature_max_c, K, to which current_max_a heats a wire at this limit within `for_s`."""
    limits = config.limits
    power_w = limits.current_max_a**2 * max(balance.resistance_ohm(0.0), balance.resistance_ohm(1.0))
    return balance.step(limits.temperature_max_c, power_w, 0.0, for_s) - limits.temperature_max_c
