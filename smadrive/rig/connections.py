"""How the devices of a rig file are reached: one transport per address, one client on it, and a trace of what passes.

An address is the URL of a port, or sim://NAME: a simulated device in this process, in virtual time.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.devices.retry import PAUSES_S
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import LineLock, Role, lines_of, lock_line
from smadrive.errors import BusyError, ConfigError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.trace import TraceFile
from smadrive.modbus.transports.connect import is_remote, open_transport
from smadrive.modbus.transports.transport import PortAccess, Transport
from smadrive.rig.config import DeviceConfig

SIMULATED = "sim://"
"""Such a device ends with this process: it needs no guardian, and nobody remembers its trips."""

HEATING = ("heater", "supply")
"""The roles of devices that heat."""

PATIENCE = 1.5
"""A guardian waits at least so many times as long for the driver as the driver for a reply."""


class Connections:
    """One client per address, and one text line; a trace of each is named after the first device there.

    `stack` closes what is opened. A `port_access` set before that is asked at every use of a connection. The line of
    a serial port, or of a device that heats, is locked; `insists`: one that cannot be locked is used all the same.
    """

    port_access: PortAccess | None = None

    def __init__(self, stack: ExitStack, trace_folder: Path | None, *, insists: bool = False) -> None:
        self._stack = stack
        self._trace_folder = trace_folder
        self._insists = insists
        self._locks: dict[str, LineLock] = {}
        self._connected: list[Transport] = []
        self._longest_wait_s = max(PAUSES_S)
        self._masters: dict[str, ModbusClient] = {}
        self._benches: dict[str, _SimulatedBench] = {}

    def device(
        self, device: DeviceConfig, profile: Profile, given: Transport | None, read_retries: int | None
    ) -> Device | TCLabBoard:
        """The device, at its address or on the connection that is given; BusyError: another smadrive has its line."""
        if given is None and not device.url.startswith(SIMULATED):
            self._lock(device, profile)
        if not profile.has_registers:
            transport = self._alone(device, profile, given)
            return TCLabBoard(profile, transport, self._trace(device, transport, speaks_text=True))
        client = self._client(device, profile) if given is None else self._master_on(given, device)
        return Device(profile, client, device.unit_id, read_retries)

    def locks_of(self, device: DeviceConfig, profile: Profile) -> list[LineLock]:
        """The locks of the line of a device, one for each of its names."""
        lines = lines_of(key_at(device.url, profile, device.unit_id))
        return [self._locks[line] for line in lines if line in self._locks]

    def disconnect(self) -> None:
        """Let every connection go; the next request on it opens it again."""
        for transport in self._connected:
            transport.disconnect()

    def check_patience(self, watchdog_s: float) -> None:
        """ConfigError when a guardian could take a driver for dead that waits for a reply, or between two tries."""
        least_s = PATIENCE * self._longest_wait_s
        if watchdog_s < least_s:
            raise ConfigError(
                f"limits.watchdog_s = {watchdog_s:g} is too short for a guardian: the driver of this rig may wait "
                f"{self._longest_wait_s:g} s for an answer: raise it to {least_s:g}"
            )

    def _lock(self, device: DeviceConfig, profile: Profile) -> None:
        if is_remote(device.url) and profile.profile.role not in HEATING:
            return
        for line in lines_of(key_at(device.url, profile, device.unit_id)):
            try:
                if line not in self._locks:
                    self._locks[line] = self._stack.enter_context(lock_line(line, Role.DRIVER))
            except BusyError:
                if not self._insists:
                    raise

    def _client(self, device: DeviceConfig, profile: Profile) -> ModbusClient:
        if device.url.startswith(SIMULATED):
            return self._master_on(self._simulated(device, profile), device)
        if device.url not in self._masters:
            self._masters[device.url] = self._master_on(self._connect(device, profile), device)
        return self._masters[device.url]

    def _master_on(self, transport: Transport, device: DeviceConfig) -> ModbusClient:
        return ModbusClient(self._opened(transport), self._trace(device, transport, speaks_text=False))

    def _alone(self, device: DeviceConfig, profile: Profile, given: Transport | None) -> Transport:
        """A connection that no other device shares."""
        if given is None and device.url.startswith(SIMULATED):
            given = self._simulated(device, profile)
        return self._opened(given or self._connect(device, profile))

    def _connect(self, device: DeviceConfig, profile: Profile) -> Transport:
        transport = open_transport(device.url, profile.serial_settings(), port_access=self.port_access)
        self._connected.append(transport)
        wait_s = profile.timing.response_timeout_ms / 1e3 + transport.latency_s
        self._longest_wait_s = max(self._longest_wait_s, wait_s)
        return transport

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
