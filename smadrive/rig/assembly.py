"""The devices of a rig file, connected: who heats, who measures what.

Devices that name the same address share its bus (rigconnections.py). A device measures every quantity that its profile
binds, or only those that the rig file lists for it; two that measure the same are refused, because only the user knows
which one is right. A source without a watchdog of its own gets a guardian.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import NamedTuple

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits, HeatSource
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.devices.sensor import PolledSensor
from smadrive.devices.state.key import DeviceKey, key_at
from smadrive.errors import ConfigError
from smadrive.modbus.transports.transport import Transport
from smadrive.rig.config import DeviceConfig, LimitsConfig, RigConfig
from smadrive.rig.connections import HEATING, SIMULATED, Connections

QUANTITIES = ("temperature", "displacement")
STALE_PERIODS = 3.0
"""A polled sensor is stale after this many of its periods, however short the rig's `stale_after_s`."""


class RigDevices(NamedTuple):
    """The heater with its sensors, every device by its name, the clock that they share.

    `source` is the device that heats, `port_key` its key before it has answered; None: it ends with this process.
    """

    heater: Heater
    by_name: Mapping[str, Device | TCLabBoard]
    clock: Clock
    source: Device | TCLabBoard
    port_key: DeviceKey | None

    def key(self) -> DeviceKey | None:
        """The key of the device that heats, which must have proved its identity."""
        if self.port_key is None:
            return None
        return self.port_key.with_identity(self.source.profile, self.source.identity)


def open_devices(
    config: RigConfig,
    stack: ExitStack,
    clock: Clock | None,
    transports: Mapping[str, Transport],
    trace_folder: Path | None = None,
) -> RigDevices:
    """Open what the rig file names; `stack` closes it. Nothing is sent yet.

    `transports` (by device name) take the place of connections; `clock` that of theirs; what passes on each of them is
    traced to a file in `trace_folder`, if it is given. ConfigError when the devices do not make up a rig or a trace
    cannot be written, TransportError when a port does not open.
    """
    profiles = {device.name: load_profile(device.profile) for device in config.devices}
    roles = _roles(config.devices, profiles)
    simulated = roles.heater.name in transports or roles.heater.url.startswith(SIMULATED)
    connections = Connections(stack, trace_folder)
    guard = None
    if not (simulated or _source_type(profiles[roles.heater.name]).has_watchdog):
        guard = GuardianClient(_guardian_task(roles.heater, config.limits), connections.disconnect)
        connections.port_access = guard.heartbeat
    for url in {device.url for device in config.devices if not device.url.startswith(SIMULATED)}:
        _check_line(url, [device for device in config.devices if device.url == url], profiles)
    devices = {
        device.name: connections.device(
            device, profiles[device.name], transports.get(device.name), None if device == roles.heater else 0
        )
        for device in config.devices
    }
    clock = clock or next(iter(devices.values())).clock
    sensors = {
        quantity: _sensor(device, devices[device.name], quantity, config.limits, 1.0 / config.rate_hz, clock)
        for quantity, device in roles.sensors.items()
    }
    limits = config.limits
    if guard is not None:
        connections.check_patience(limits.watchdog_s)
        guard.share(connections.locks_of(roles.heater, profiles[roles.heater.name]))
        stack.enter_context(guard)
    heater = Heater(
        heat_source(roles.heater, devices[roles.heater.name], clock),
        HeaterLimits(limits.current_max_a, limits.temperature_max_c, limits.voltage_max_v or inf),
        clock,
        sensors.get("temperature"),
        sensors.get("displacement"),
        guard,
    )
    key = None if simulated else key_at(roles.heater.url, profiles[roles.heater.name], roles.heater.unit_id)
    return RigDevices(heater, devices, clock, devices[roles.heater.name], key)


class _Roles(NamedTuple):
    heater: DeviceConfig
    sensors: dict[str, DeviceConfig]  # the quantities that the heater does not measure itself


def _roles(devices: tuple[DeviceConfig, ...], profiles: Mapping[str, Profile]) -> _Roles:
    heaters = [device for device in devices if profiles[device.name].profile.role in HEATING]
    if len(heaters) != 1:
        names = ", ".join(f"'{device.name}'" for device in heaters) or "none"
        raise ConfigError(f"a rig has one device that heats, of role 'heater' or 'supply'; this one has {names}")
    sensors: dict[str, DeviceConfig] = {}
    for quantity in QUANTITIES:
        measuring = [device for device in devices if _measures(device, profiles[device.name], quantity)]
        if len(measuring) > 1:
            names = ", ".join(f"'{device.name}'" for device in measuring)
            raise ConfigError(
                f"the devices {names} all measure the {quantity}: say which one counts by "
                f'measures = ["{quantity}"] there, and measures = [] at the others'
            )
        if measuring and measuring != heaters:
            sensors[quantity] = measuring[0]
    return _Roles(heaters[0], sensors)


def _check_line(url: str, devices: Sequence[DeviceConfig], profiles: Mapping[str, Profile]) -> None:
    """ConfigError when the devices at one address cannot be told apart."""
    units: dict[int, str] = {}
    for device in devices:
        profile = profiles[device.name]
        if len(devices) > 1 and not profile.has_registers:
            raise ConfigError(f"device '{device.name}': '{device.profile}' needs {url} for itself: move the others")
        unit_id = profile.unit_id if device.unit_id is None else device.unit_id
        other = units.setdefault(unit_id, device.name)
        if other != device.name:
            raise ConfigError(
                f"the devices '{other}' and '{device.name}' both have unit id {unit_id} at {url}: give one of them "
                "another (at the device, and by unit_id in the rig file)"
            )


def _measures(device: DeviceConfig, profile: Profile, quantity: str) -> bool:
    bound = getattr(profile.roles, quantity) is not None
    if device.measures is None:
        return bound
    if quantity in device.measures and not bound:
        raise ConfigError(
            f"device '{device.name}' is to measure the {quantity}, but its profile '{device.profile}' binds none"
        )
    return quantity in device.measures


def _source_type(profile: Profile) -> type[HeaterBoard | BenchSupply | TCLab]:
    if not profile.has_registers:
        return TCLab
    return HeaterBoard if profile.profile.role == "heater" else BenchSupply


def heat_source(config: DeviceConfig, device: Device | TCLabBoard, clock: Clock) -> HeatSource:
    """The device as that which heats; ConfigError when the rig file tells too much or too little of it for that."""
    scales = config.full_scale_a, config.full_scale_v
    if isinstance(device, Device):
        if scales != (None, None):
            raise ConfigError(
                f"device '{config.name}': '{config.profile}' is commanded in amperes: leave full_scale_a and "
                "full_scale_v out"
            )
        return HeaterBoard(device, clock) if _source_type(device.profile) is HeaterBoard else BenchSupply(device)
    if config.full_scale_a is None or config.full_scale_v is None:
        raise ConfigError(
            f"device '{config.name}': '{config.profile}' is commanded by duty: set full_scale_a and full_scale_v to "
            "what it drives through this wire at 100 %"
        )
    return TCLab(device, config.full_scale_a, config.full_scale_v)


def _guardian_task(device: DeviceConfig, limits: LimitsConfig) -> Task:
    return Task(GuardedDevice(device.profile, device.url, device.unit_id), limits.watchdog_s)


def _sensor(
    config: DeviceConfig, device: Device | TCLabBoard, quantity: str, limits: LimitsConfig, tick_s: float, clock: Clock
) -> PolledSensor:
    assert isinstance(device, Device)  # what a TCLab measures, it measures as a heat source
    period_s = tick_s if config.rate_hz is None else 1.0 / config.rate_hz
    period_s = max(period_s, device.profile.timing.update_ms / 1e3)
    return PolledSensor(device, quantity, period_s, max(limits.stale_after_s, STALE_PERIODS * period_s), clock)
