"""The plan of a rig, which gives every device its task. It is derived from the rig file and the device profiles.

This module opens no port: devices that contradict each other raise ConfigError before any port is opened. Exactly one
device heats. Two devices that measure the same quantity are an error, because only the user knows which one is right. A
heat source without a watchdog of its own needs a guardian, a process that switches it off when the driver fails.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite

from smadrive.devices.calibration import Corrections
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import Profile
from smadrive.devices.retry import PAUSES_S
from smadrive.errors import ConfigError
from smadrive.modbus.bus_line import REOPENS_WITHIN_S
from smadrive.modbus.transports.connect import is_remote, line_settings, port_of
from smadrive.rig.config import LimitsConfig, RigConfig
from smadrive.rig.planned_device import SIMULATED, PlannedDevice, check_full_scales

QUANTITIES = ("temperature", "displacement")

STALE_PERIODS = 3.0
"""A polled sensor becomes stale only after this many of its periods, even if `stale_after_s` is shorter."""

SLOW_PERIODS = 2.0
"""A sensor that is read less often than once in this many periods of the loop gives a warning."""

GUARDIAN_PATIENCE = 1.5
"""Smallest `watchdog_s` with a guardian, as a multiple of the longest time that the driver waits for a reply."""


@dataclass(frozen=True)
class PlannedSensor:
    """A device besides the heat source. It measures `quantity` every `period_s`; its value is stale after `stale_s`."""

    device: PlannedDevice
    quantity: str
    period_s: float
    stale_s: float


@dataclass(frozen=True)
class RigPlan:
    """The devices of a rig and their tasks. `guardian` is the task of the guardian process; None: no guardian.

    `answers_within_s` is the time in s within which an armed supply must answer again; `caveats` are warnings, one
    sentence each.
    """

    devices: tuple[PlannedDevice, ...]
    source: PlannedDevice
    sensors: tuple[PlannedSensor, ...]
    limits: HeaterLimits
    guardian: Task | None
    answers_within_s: float
    corrections: Corrections
    caveats: tuple[str, ...]


def plan_rig(config: RigConfig, profiles: Mapping[str, Profile], given: Collection[str] = ()) -> RigPlan:
    """Return the plan of the rig; `profiles` maps device names to profiles.

    `given` holds the names of the devices whose connection the caller supplies. ConfigError when the devices contradict
    each other.
    """
    where = f"rig '{config.name}'"
    devices = tuple(PlannedDevice(device, profiles[device.name], device.name in given) for device in config.devices)
    source = _source(devices, where)
    sensors = tuple(_sensors(devices, source, config, where))
    check_full_scales(source)
    _check_thermometer(source, sensors, where)
    _check_addresses(devices, where)
    guardian = _guardian(source, devices, config.limits, where)
    limits, corrections = _limits(config.limits), config.calibration.corrections()
    caveats = *_slow(sensors, config), *_indispensable(sensors, devices, config), *_unlimited(source, limits)
    return RigPlan(devices, source, sensors, limits, guardian, stale_after_s(config), corrections, caveats)


def stale_after_s(config: RigConfig) -> float:
    """Return the longest allowed time between two measurements of a run, s."""
    return max(config.limits.stale_after_s, STALE_PERIODS / config.rate_hz)


def _slow(sensors: Iterable[PlannedSensor], config: RigConfig) -> Iterator[str]:
    """Yield a warning for each sensor that is slow for the loop: most ticks have an old reading."""
    for sensor in sensors:
        if sensor.period_s * config.rate_hz > SLOW_PERIODS:
            yield (
                f"'{sensor.device.name}' gives a new {sensor.quantity} only every {sensor.period_s:g} s, but the loop "
                f"runs every {1.0 / config.rate_hz:g} s: most of its readings are old: set rate_hz of the rig to "
                f"{1.0 / sensor.period_s:.3g}"
            )


def _indispensable(
    sensors: Iterable[PlannedSensor], devices: Sequence[PlannedDevice], config: RigConfig
) -> Iterator[str]:
    """Yield a warning for each displacement sensor whose silence would delay a tick until the run ends."""
    limit_s = min(stale_after_s(config), config.limits.watchdog_s)
    for device in (sensor.device for sensor in sensors if sensor.quantity == "displacement"):
        tick_s = 1.0 / config.rate_hz + _silent_s(device, devices)
        if tick_s > limit_s:
            yield (
                f"a run ends if '{device.name}' falls silent, because a tick then takes {tick_s:.2g} s: set "
                "stale_after_s and watchdog_s to more than that, so that the run goes on"
            )


def _silent_s(device: PlannedDevice, devices: Sequence[PlannedDevice]) -> float:
    """Return the time by which the device delays a tick when it falls silent, s (see `PolledSensor.delay_s`)."""
    timeout_s = device.reply_timeout_s
    if device.is_simulated:
        return timeout_s
    sharing = [one for one in devices if not one.is_simulated and port_of(one.config.url) == port_of(device.config.url)]
    quiet_s = max(one.reply_timeout_s for one in sharing) if len(sharing) > 1 else 0.0
    return timeout_s + quiet_s + (REOPENS_WITHIN_S if is_remote(device.config.url) else 0.0)


def _unlimited(source: PlannedDevice, limits: HeaterLimits) -> Iterator[str]:
    """Yield a warning if the heater is a board, which cannot limit its voltage, and the voltage has a limit."""
    if source.source_type is HeaterBoard and isfinite(limits.voltage_max_v):
        yield f"voltage_max_v has no effect: '{source.config.name}' cannot limit its voltage. Limit its supply"


def _source(devices: Sequence[PlannedDevice], where: str) -> PlannedDevice:
    """Return the one device that heats."""
    heating = [device for device in devices if device.heats]
    if len(heating) != 1:
        raise ConfigError(
            "a rig needs exactly one device that heats", where=where, value=_names(heating) or "none", limit="one"
        )
    return heating[0]


def _sensors(
    devices: Sequence[PlannedDevice], source: PlannedDevice, config: RigConfig, where: str
) -> Iterator[PlannedSensor]:
    """Yield the sensors of the quantities that the source does not measure itself."""
    for quantity in QUANTITIES:
        measuring = [device for device in devices if device.measures(quantity)]
        if len(measuring) > 1:
            raise ConfigError(
                f"several devices measure the {quantity}",
                where=where,
                value=_names(measuring),
                cure=f'write measures = ["{quantity}"] at the right device, and measures = [] at the others',
            )
        if measuring and measuring != [source]:
            yield _sensor(measuring[0], quantity, config)


def _sensor(device: PlannedDevice, quantity: str, config: RigConfig) -> PlannedSensor:
    """Return the sensor, read at its `rate_hz` or else the loop's.

    It is never read faster than the loop runs, because the loop reads it, or than the device converts.
    """
    rate_hz = min(device.config.rate_hz or config.rate_hz, config.rate_hz)
    period_s = max(1.0 / rate_hz, device.profile.timing.update_ms / 1e3)
    return PlannedSensor(device, quantity, period_s, max(config.limits.stale_after_s, STALE_PERIODS * period_s))


def _check_thermometer(source: PlannedDevice, sensors: Iterable[PlannedSensor], where: str) -> None:
    if "temperature" not in {*source.source_measures, *(sensor.quantity for sensor in sensors)}:
        raise ConfigError(
            "no device measures the temperature of the wire", where=where, cure="add a thermometer to [[devices]]"
        )


def _check_addresses(devices: Sequence[PlannedDevice], where: str) -> None:
    """Raise ConfigError if devices at one port cannot share it, or simulated devices are on two benches."""
    sharing: dict[str, list[PlannedDevice]] = {}
    for device in devices:
        if not device.config.url.startswith(SIMULATED):
            sharing.setdefault(port_of(device.config.url), []).append(device)
    for port, at_port in sharing.items():
        _check_port(port, at_port)
    urls = {device.config.url for device in devices if device.is_simulated and not device.is_given}
    if len({url.partition("?")[0] for url in urls}) > 1:
        what, cure = "the simulated devices of a rig must share one bench", "give all simulated devices the same url"
        raise ConfigError(what, where=where, value=", ".join(sorted(urls)), cure=cure)


def _check_port(port: str, devices: Sequence[PlannedDevice]) -> None:
    """Raise ConfigError if a device cannot share its port with other devices, or two devices have the same unit id."""
    by_unit: dict[int, PlannedDevice] = {}
    for device in devices:
        if len(devices) > 1 and not device.profile.has_registers:
            what = f"'{device.config.profile}' cannot share {port} with other devices"
            raise ConfigError(what, where=device.where, cure="connect the other devices to another port")
        other = by_unit.setdefault(device.unit_id, device)
        if other is not device:
            raise ConfigError(
                f"two devices at {port} have the same unit id",
                where=f"devices '{other.name}' and '{device.name}'",
                value=device.unit_id,
                cure="set another unit id at one device, and write it into the rig file",
            )
    _check_settings(port, devices)


def _check_settings(port: str, devices: Sequence[PlannedDevice]) -> None:
    """Raise ConfigError if devices at one port have different urls or line settings.

    The driver opens the port for one of the devices. The guardian and `off` open it for the heat source.
    """
    where = f"devices {_names(devices)}"
    urls = dict.fromkeys(device.config.url for device in devices)
    if len(urls) > 1:
        what, cure = "the devices share a port, but their urls differ", "write the same url at all of them"
        raise ConfigError(what, where=where, value=", ".join(urls), cure=cure)
    lines = {str(line_settings(device.config.url, device.profile.serial_settings())) for device in devices}
    if len(lines) > 1:
        raise ConfigError(
            f"devices at {port} need the same line settings",
            where=where,
            value=", ".join(sorted(lines)),
            cure="set the devices alike, and write ?baudrate=…&parity=…&stopbits=… into their url",
        )


def _limits(limits: LimitsConfig) -> HeaterLimits:
    return HeaterLimits(limits.current_max_a, limits.temperature_max_c, limits.voltage_max_v or inf)


def _guardian(source: PlannedDevice, devices: Iterable[PlannedDevice], limits: LimitsConfig, where: str) -> Task | None:
    """Return the task of the guardian, or None if the source needs none; ConfigError if `watchdog_s` is too short."""
    if source.is_simulated or source.source_type.has_watchdog:
        return None
    longest_s = max(*PAUSES_S, *(device.reply_timeout_s for device in devices if not device.is_simulated))
    if limits.watchdog_s < GUARDIAN_PATIENCE * longest_s:
        raise ConfigError(
            f"limits.watchdog_s is too short for a guardian, because the driver may wait {longest_s:g} s for a reply",
            where=where,
            value=f"{limits.watchdog_s:g} s",
            limit=f"{GUARDIAN_PATIENCE * longest_s:g} s",
            cure="raise limits.watchdog_s",
        )
    device = source.config
    guarded = GuardedDevice(device.profile, device.url, device.unit_id, current_max_a=limits.current_max_a)
    return Task(guarded, limits.watchdog_s)


def _names(devices: Iterable[PlannedDevice]) -> str:
    return ", ".join(f"'{device.name}'" for device in devices)
