"""The devices of a rig file, connected: one transport per address, and who heats, who measures what.

Devices that name the same address share its bus. A device measures every quantity that its profile binds, or only those
that the rig file lists for it; two that measure the same are refused, because only the user knows which one is right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import NamedTuple

from smadrive.clock import Clock, VirtualClock
from smadrive.device.anydevice import AnyDevice
from smadrive.device.board import HeaterBoard
from smadrive.device.device import Device
from smadrive.device.guard import Guard
from smadrive.device.guardian import GuardedDevice, Task
from smadrive.device.heater import Heater
from smadrive.device.heatsource import HeaterLimits, HeatSource
from smadrive.device.profile import Profile, load_profile
from smadrive.device.sensor import PolledSensor
from smadrive.device.supply import BenchSupply
from smadrive.device.tclab import TCLab, TCLabBoard
from smadrive.errors import ConfigError
from smadrive.latch import TripLatch
from smadrive.modbus.connect import open_transport
from smadrive.modbus.master import Master
from smadrive.modbus.trace import TraceFile
from smadrive.modbus.transport import Transport
from smadrive.rigconfig import DeviceConfig, LimitsConfig, RigConfig

SIMULATED = "sim://"
"""A simulated device in this process ends with it: it needs no guardian, and nobody remembers its trips."""

QUANTITIES = ("temperature", "displacement")
STALE_PERIODS = 3.0
"""A polled sensor is stale after this many of its periods, however short the rig's `stale_after_s`."""


class RigDevices(NamedTuple):
    """The heater with its sensors, every device by its name, the clock that they share, and the heater's last trip."""

    heater: Heater
    by_name: Mapping[str, AnyDevice]
    clock: Clock
    latch: TripLatch


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
    connections = _Connections(stack, trace_folder)
    profiles = {device.name: load_profile(device.profile) for device in config.devices}
    roles = _roles(config.devices, profiles)
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
    source = _source(roles.heater, devices[roles.heater.name], clock)
    simulated = roles.heater.name in transports or roles.heater.url.startswith(SIMULATED)
    unguarded = source.has_watchdog or simulated
    heater = Heater(
        source,
        HeaterLimits(limits.current_max_a, limits.temperature_max_c, limits.voltage_max_v or inf),
        clock,
        sensors.get("temperature"),
        sensors.get("displacement"),
        None if unguarded else stack.enter_context(Guard(_guardian_task(roles.heater, limits))),
    )
    return RigDevices(heater, devices, clock, TripLatch(None if simulated else _address(roles.heater)))


class _Roles(NamedTuple):
    heater: DeviceConfig
    sensors: dict[str, DeviceConfig]  # the quantities that the heater does not measure itself


def _roles(devices: tuple[DeviceConfig, ...], profiles: Mapping[str, Profile]) -> _Roles:
    heaters = [device for device in devices if profiles[device.name].profile.role in ("heater", "supply")]
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


def _source(config: DeviceConfig, device: Device | TCLabBoard, clock: Clock) -> HeatSource:
    scales = config.full_scale_a, config.full_scale_v
    if isinstance(device, Device):
        if scales != (None, None):
            raise ConfigError(
                f"device '{config.name}': '{config.profile}' is commanded in amperes: leave full_scale_a and "
                "full_scale_v out"
            )
        return HeaterBoard(device, clock) if device.profile.profile.role == "heater" else BenchSupply(device)
    if config.full_scale_a is None or config.full_scale_v is None:
        raise ConfigError(
            f"device '{config.name}': '{config.profile}' is commanded by duty: set full_scale_a and full_scale_v to "
            "what it drives through this wire at 100 %"
        )
    return TCLab(device, config.full_scale_a, config.full_scale_v)


def _address(device: DeviceConfig) -> str:
    return device.url if device.unit_id is None else f"{device.url} unit {device.unit_id}"


def _guardian_task(device: DeviceConfig, limits: LimitsConfig) -> Task:
    return Task((GuardedDevice(device.profile, device.url, device.unit_id),), limits.watchdog_s)


def _sensor(
    config: DeviceConfig, device: Device | TCLabBoard, quantity: str, limits: LimitsConfig, tick_s: float, clock: Clock
) -> PolledSensor:
    assert isinstance(device, Device)  # what a TCLab measures, it measures as a heat source
    period_s = tick_s if config.rate_hz is None else 1.0 / config.rate_hz
    period_s = max(period_s, device.profile.timing.update_ms / 1e3)
    return PolledSensor(device, quantity, period_s, max(limits.stale_after_s, STALE_PERIODS * period_s), clock)


class _Connections:
    """One master per address, and one text line; a trace of each is named after the first device there."""

    def __init__(self, stack: ExitStack, trace_folder: Path | None) -> None:
        self._stack = stack
        self._trace_folder = trace_folder
        self._masters: dict[str, Master] = {}
        self._benches: dict[str, _SimulatedBench] = {}

    def device(
        self, device: DeviceConfig, profile: Profile, given: Transport | None, read_retries: int | None
    ) -> Device | TCLabBoard:
        """The device, at its address or on the connection that is given."""
        if not profile.has_registers:
            transport = self._alone(device, profile, given)
            return TCLabBoard(profile, transport, self._trace(device, transport, speaks_text=True))
        master = self._master(device, profile) if given is None else self._master_on(given, device)
        return Device(profile, master, device.unit_id, read_retries)

    def _master(self, device: DeviceConfig, profile: Profile) -> Master:
        if device.url.startswith(SIMULATED):
            return self._master_on(self._simulated(device, profile), device)
        if device.url not in self._masters:
            transport = open_transport(device.url, profile.serial_settings())
            self._masters[device.url] = self._master_on(transport, device)
        return self._masters[device.url]

    def _master_on(self, transport: Transport, device: DeviceConfig) -> Master:
        return Master(self._opened(transport), self._trace(device, transport, speaks_text=False))

    def _alone(self, device: DeviceConfig, profile: Profile, given: Transport | None) -> Transport:
        """A connection that no other device shares."""
        if given is None and device.url.startswith(SIMULATED):
            given = self._simulated(device, profile)
        return self._opened(given or open_transport(device.url, profile.serial_settings()))

    def _opened(self, transport: Transport) -> Transport:
        return self._stack.enter_context(transport)

    def _trace(self, device: DeviceConfig, transport: Transport, *, speaks_text: bool) -> TraceFile | None:
        if self._trace_folder is None:
            return None
        try:
            self._trace_folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"{self._trace_folder}: no folder for traces ({error.strerror})") from None
        path = self._trace_folder / f"{device.name}.trace"
        return self._stack.enter_context(TraceFile(path, transport, speaks_text=speaks_text))

    def _simulated(self, device: DeviceConfig, profile: Profile) -> Transport:
        """A simulated device in this process, in virtual time; those of one address stand on one bench.

        sim://NAME?profile=OTHER puts a device of another type there than the rig file believes.
        """
        sim, _, other = device.url.removeprefix(SIMULATED).partition("?profile=")
        if self._benches and sim not in self._benches:
            raise ConfigError(f"'{device.url}': the simulated devices of a rig stand on one bench: name the same one")
        bench = self._benches.setdefault(sim, _SimulatedBench(sim))
        return bench.transport(load_profile(other) if other else profile, device)


class _SimulatedBench:
    """The door to the simulator; no other address opens it."""

    def __init__(self, sim: str) -> None:
        from firmware_sim.bench import SimulatedBench  # noqa: PLC0415
        from firmware_sim.config import load_sim  # noqa: PLC0415

        self._clock = VirtualClock()
        self._bench = SimulatedBench(load_sim(sim))
        self._clock.follow(self._bench.advance_to)

    def transport(self, profile: Profile, device: DeviceConfig) -> Transport:
        return self._bench.attach(profile, device.unit_id, device.name).transport(self._clock)
