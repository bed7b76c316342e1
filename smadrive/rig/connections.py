"""Connections to the devices of a rig, with locks and traces.

An address is the URL of a port, or sim://NAME for a simulated device in this process and in virtual time. All Modbus
devices with the same port URL share one transport and one client; each simulated device has its own.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from smadrive.devices.device import Device
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.state.key import DeviceKey, key_at
from smadrive.devices.state.lock import LineLock, Role, lines_of, lock_line
from smadrive.devices.stopping.endpoint import names_of_line
from smadrive.devices.stopping.listener import StopListener
from smadrive.errors import BusyError, ConfigError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.trace import TraceFile
from smadrive.modbus.transports.connect import is_one_line, open_transport
from smadrive.modbus.transports.transport import PortAccess, Transport
from smadrive.rig.planned_device import SIMULATED, PlannedDevice
from smadrive.rig.simulation import SimulatedConnections, simulate


class Connections:
    """Opens the connections; `stack` closes them. A trace file has the name of the first device on its connection.

    `access` is called before each use of a connection (see `PortAccess`), if it was set before that connection was
    opened. A serial line is always locked, also behind a socket; a unit of a gateway only if it heats. A line that
    another process has locked is used only in the role OFF. `stop` listens for an emergency stop at every line as soon
    as the line is locked.
    """

    access: PortAccess | None = None

    def __init__(
        self, stack: ExitStack, trace_folder: Path | None, *, role: Role = Role.DRIVER, stop: StopListener | None = None
    ) -> None:
        self._stack = stack
        self._trace_folder = trace_folder
        self._role = role
        self._stop = stop
        self._locks: dict[str, LineLock] = {}
        self._connected: list[Transport] = []
        self._clients: dict[str, ModbusClient] = {}
        self._simulations: dict[str, SimulatedConnections] = {}

    def device(
        self, device: PlannedDevice, given: Transport | None = None, read_retries: int | None = None
    ) -> Device | TCLabBoard:
        """Return the device at its address, or on the connection `given`.

        `read_retries` replaces the value in the profile if it is not None. BusyError if another process has locked the
        line of the device, except in the role OFF.
        """
        if not device.is_simulated:
            self._lock(device)
        if not device.profile.has_registers:
            transport = self._stack.enter_context(given or self._connect(device))
            return TCLabBoard(device.profile, transport, self._trace(device, transport, speaks_text=True))
        client = self._client(device) if given is None else self._client_on(given, device)
        return Device(device.profile, client, device.config.unit_id, read_retries)

    def locks_of(self, device: PlannedDevice) -> list[LineLock]:
        """Return the locks of the device's line, one for each name of the line."""
        return [self._locks[line] for line in line_names(device) if line in self._locks]

    def disconnect(self) -> None:
        """Close every connection. The next request opens its connection again."""
        for transport in self._connected:
            transport.disconnect()

    def _lock(self, device: PlannedDevice) -> None:
        if not (device.heats or is_one_line(device.config.url)):
            return
        for line in line_names(device):
            try:
                if line not in self._locks:
                    self._locks[line] = self._stack.enter_context(lock_line(line, self._role))
                    if self._stop is not None:
                        self._stop.listen(line, names_of_line(line, key_of(device)))
            except BusyError as error:
                if self._role is not Role.OFF:
                    error.where = _place(device.config.url, error.where)
                    raise

    def _client(self, device: PlannedDevice) -> ModbusClient:
        """Return the client of the device's address. Each simulated device has a client of its own."""
        if device.is_simulated:
            return self._client_on(self._connect(device), device)
        url = device.config.url
        if url not in self._clients:
            self._clients[url] = self._client_on(self._connect(device), device)
        return self._clients[url]

    def _client_on(self, transport: Transport, device: PlannedDevice) -> ModbusClient:
        opened = self._stack.enter_context(transport)
        return ModbusClient(opened, self._trace(device, transport, speaks_text=False))

    def _connect(self, device: PlannedDevice) -> Transport:
        if device.is_simulated:
            return self._simulated(device)
        transport = open_transport(device.config.url, device.profile.serial_settings(), port_access=self.access)
        self._connected.append(transport)
        return transport

    def _simulated(self, device: PlannedDevice) -> Transport:
        """Return a connection to a simulated device in this process. Devices with the same sim://NAME share one bench.

        sim://NAME?profile=OTHER simulates a device with the profile OTHER instead of the profile in the rig file.
        """
        name, _, other = device.config.url.removeprefix(SIMULATED).partition("?profile=")
        if name not in self._simulations:
            self._simulations[name] = simulate(name)
        return self._simulations[name].transport(device.config, other)

    def _trace(self, device: PlannedDevice, transport: Transport, *, speaks_text: bool) -> TraceFile | None:
        if self._trace_folder is None:
            return None
        try:
            self._trace_folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            cure = "choose a folder that you may write to; each device gets a trace file in it"
            what, where = "the folder for traces cannot be made", self._trace_folder
            raise ConfigError(what, where=where, value=error.strerror, cure=cure) from None
        path = self._trace_folder / f"{device.name}.trace"
        return self._stack.enter_context(TraceFile(path, transport, speaks_text=speaks_text))


def _place(url: str, line: str) -> str:
    """Return `url`, and in brackets the name `line` of its line if the two differ."""
    return url if url.partition("?")[0] == line else f"{url} ({line})"


def line_names(device: PlannedDevice) -> tuple[str, ...]:
    """Return all names of the line of a device (see `lines_of`). A simulated device has no line, so no name."""
    if device.is_simulated:
        return ()
    return lines_of(key_of(device))


def key_of(device: PlannedDevice) -> DeviceKey:
    """Return the key of a device on a port. The device has not answered yet, so its serial number is unknown."""
    return key_at(device.config.url, device.profile, device.config.unit_id)
