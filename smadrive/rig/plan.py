"""The plan of a rig: what each device does, derived from the rig file and the device profiles alone.

Nothing here opens a port. Devices that do not make up a rig are a ConfigError here, before anything is opened.

One device heats. A device measures every quantity that its profile has a register for, or only those that the rig file
lists for it. Two devices that measure the same quantity are an error, because only the user knows which one is right.
A heat source without a watchdog of its own needs a guardian.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.profile.profile import Profile
from smadrive.devices.retry import PAUSES_S
from smadrive.errors import ConfigError
from smadrive.modbus.transports.connect import latency_s_of
from smadrive.rig.config import DeviceConfig, LimitsConfig, RigConfig

SIMULATED = "sim://"
"""Such a device ends with this process: it needs no guardian, and its trips are not kept."""

HEATING_ROLES = ("heater", "supply")

QUANTITIES = ("temperature", "displacement")

STALE_PERIODS = 3.0
"""A polled sensor is stale after this many of its periods, however short the rig's `stale_after_s` is."""

GUARDIAN_PATIENCE = 1.5
"""A guardian waits for the driver at least this many times as long as the driver waits for a reply."""


@dataclass(frozen=True)
class PlannedDevice:
    """A device of the rig file and its profile. `is_given`: the caller supplies the connection to it."""

    config: DeviceConfig
    profile: Profile
    is_given: bool = False

    @property
    def name(self) -> str:
        """The device's name in the rig file."""
        return self.config.name

    @property
    def where(self) -> str:
        """The device as error messages name it."""
        return f"device '{self.name}'"

    @property
    def heats(self) -> bool:
        """Whether the device drives current through the wire."""
        return self.profile.profile.role in HEATING_ROLES

    @property
    def is_simulated(self) -> bool:
        """Whether the device has no port of its own: it is simulated in this process, or its connection is given."""
        return self.is_given or self.config.url.startswith(SIMULATED)

    @property
    def unit_id(self) -> int:
        """The unit id of the rig file, or else the factory setting of the device."""
        return self.profile.unit_id if self.config.unit_id is None else self.config.unit_id

    @property
    def source_type(self) -> type[HeaterBoard | BenchSupply | TCLab]:
        """The class that heats with this device."""
        if not self.profile.has_registers:
            return TCLab
        return HeaterBoard if self.profile.profile.role == "heater" else BenchSupply

    def measures(self, quantity: str) -> bool:
        """Whether the rig takes `quantity` from this device. ConfigError when the device cannot measure it."""
        has_register = getattr(self.profile.roles, quantity) is not None
        if self.config.measures is None:
            return has_register
        if quantity in self.config.measures and not has_register:
            raise ConfigError(
                f"the profile '{self.config.profile}' has no {quantity} register",
                where=self.where,
                cure=f'remove "{quantity}" from its measures',
            )
        return quantity in self.config.measures


@dataclass(frozen=True)
class PlannedSensor:
    """A device that measures `quantity` beside the heat source: read every `period_s`, stale after `stale_s`."""

    device: PlannedDevice
    quantity: str
    period_s: float
    stale_s: float


@dataclass(frozen=True)
class RigPlan:
    """The devices of a rig and what each of them does. `guardian`: the task of the guardian, None without one."""

    devices: tuple[PlannedDevice, ...]
    source: PlannedDevice
    sensors: tuple[PlannedSensor, ...]
    limits: HeaterLimits
    guardian: Task | None


def plan_rig(config: RigConfig, profiles: Mapping[str, Profile], given: Collection[str] = ()) -> RigPlan:
    """The plan of the rig; `profiles` by the names of the devices, `given` names those with a connection already.

    ConfigError when the devices do not make up a rig.
    """
    where = f"rig '{config.name}'"
    devices = tuple(PlannedDevice(device, profiles[device.name], device.name in given) for device in config.devices)
    source = _source(devices, where)
    sensors = tuple(_sensors(devices, source, config, where))
    check_full_scales(source)
    _check_thermometer(source, sensors, where)
    _check_addresses(devices, where)
    return RigPlan(devices, source, sensors, _limits(config.limits), _guardian(source, devices, config.limits, where))


def check_full_scales(source: PlannedDevice) -> None:
    """ConfigError when the rig file gives full scales to a source in amperes, or none to a source in percent."""
    scales = source.config.full_scale_a, source.config.full_scale_v
    if source.source_type is TCLab and None in scales:
        raise ConfigError(
            f"'{source.config.profile}' is commanded by duty and needs full scales",
            where=source.where,
            cure="set full_scale_a and full_scale_v to what it drives through this wire at 100 %",
        )
    if source.source_type is not TCLab and scales != (None, None):
        raise ConfigError(
            f"'{source.config.profile}' is commanded in amperes and has no full scales",
            where=source.where,
            cure="remove full_scale_a and full_scale_v",
        )


def _source(devices: Sequence[PlannedDevice], where: str) -> PlannedDevice:
    """The one device that heats."""
    heating = [device for device in devices if device.heats]
    if len(heating) != 1:
        raise ConfigError(
            "a rig has exactly one device that heats", where=where, value=_names(heating) or "none", limit="one"
        )
    return heating[0]


def _sensors(
    devices: Sequence[PlannedDevice], source: PlannedDevice, config: RigConfig, where: str
) -> Iterator[PlannedSensor]:
    """The sensors of the quantities that the source does not measure itself."""
    for quantity in QUANTITIES:
        measuring = [device for device in devices if device.measures(quantity)]
        if len(measuring) > 1:
            raise ConfigError(
                f"several devices measure the {quantity}",
                where=where,
                value=_names(measuring),
                cure=f'write measures = ["{quantity}"] at the one that counts, and measures = [] at the others',
            )
        if measuring and measuring != [source]:
            yield _sensor(measuring[0], quantity, config)


def _sensor(device: PlannedDevice, quantity: str, config: RigConfig) -> PlannedSensor:
    """The sensor is read at every tick, or at the rate of the rig file, and never faster than it converts."""
    period_s = max(1.0 / (device.config.rate_hz or config.rate_hz), device.profile.timing.update_ms / 1e3)
    return PlannedSensor(device, quantity, period_s, max(config.limits.stale_after_s, STALE_PERIODS * period_s))


def _check_thermometer(source: PlannedDevice, sensors: Iterable[PlannedSensor], where: str) -> None:
    if "temperature" not in {*source.source_type.measures, *(sensor.quantity for sensor in sensors)}:
        raise ConfigError(
            "no device measures the temperature of the wire", where=where, cure="add one to the rig's [[devices]]"
        )


def _check_addresses(devices: Sequence[PlannedDevice], where: str) -> None:
    """ConfigError when the devices at one address cannot be told apart, or simulated ones are on two benches."""
    for url in {device.config.url for device in devices if not device.config.url.startswith(SIMULATED)}:
        _check_line(url, [device for device in devices if device.config.url == url])
    urls = {device.config.url for device in devices if device.is_simulated and not device.is_given}
    if len({url.partition("?")[0] for url in urls}) > 1:
        raise ConfigError(
            "the simulated devices of a rig must share one bench",
            where=where,
            value=", ".join(sorted(urls)),
            cure="give them the same url",
        )


def _check_line(url: str, devices: Sequence[PlannedDevice]) -> None:
    """ConfigError when a device needs the line for itself, or two have the same unit id."""
    by_unit: dict[int, PlannedDevice] = {}
    for device in devices:
        if len(devices) > 1 and not device.profile.has_registers:
            raise ConfigError(
                f"'{device.config.profile}' cannot share {url} with other devices",
                where=device.where,
                cure="connect the others to another port",
            )
        other = by_unit.setdefault(device.unit_id, device)
        if other is not device:
            raise ConfigError(
                f"two devices at {url} have the same unit id",
                where=f"devices '{other.name}' and '{device.name}'",
                value=device.unit_id,
                cure="set another one at the device, and as its unit_id in the rig file",
            )


def _limits(limits: LimitsConfig) -> HeaterLimits:
    return HeaterLimits(limits.current_max_a, limits.temperature_max_c, limits.voltage_max_v or inf)


def _guardian(source: PlannedDevice, devices: Iterable[PlannedDevice], limits: LimitsConfig, where: str) -> Task | None:
    """The task of the guardian. ConfigError when it could mistake a driver that waits for a reply for a dead one."""
    if source.is_simulated or source.source_type.has_watchdog:
        return None
    longest_s = max(*PAUSES_S, *(_reply_timeout_s(device) for device in devices if not device.is_simulated))
    if limits.watchdog_s < GUARDIAN_PATIENCE * longest_s:
        raise ConfigError(
            f"limits.watchdog_s is too short for a guardian: the driver may wait {longest_s:g} s for a reply",
            where=where,
            value=f"{limits.watchdog_s:g} s",
            limit=f"{GUARDIAN_PATIENCE * longest_s:g} s",
            cure="raise it",
        )
    config = source.config
    return Task(GuardedDevice(config.profile, config.url, config.unit_id), limits.watchdog_s)


def _reply_timeout_s(device: PlannedDevice) -> float:
    return device.profile.timing.response_timeout_ms / 1e3 + latency_s_of(device.config.url)


def _names(devices: Iterable[PlannedDevice]) -> str:
    return ", ".join(f"'{device.name}'" for device in devices)
