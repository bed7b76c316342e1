"""From devices to doors: devices that name the same way in share a line, and each way in is one door."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Literal, NamedTuple

from firmware_sim.bus.line_speed import SlowLine
from firmware_sim.bus.ports import Port
from firmware_sim.config import Placed
from firmware_sim.devices.device import Line, SimulatedDevice
from firmware_sim.server.endpoint import Endpoint, Terminal
from firmware_sim.server.tcp_endpoint import TcpEndpoint
from smadrive.errors import ConfigError
from smadrive.modbus.transports.transport import SerialSettings

Kind = Literal["pty", "tcp", "rtu_tcp"]


class ListenAddress(NamedTuple):
    """Where a client finds a device: a pseudo-terminal (perhaps under a path), or a TCP address."""

    kind: Kind
    address: str | None = None

    @classmethod
    def of(cls, placed: Placed) -> ListenAddress:
        """That of a device of a sim file."""
        if placed.pty is not None:
            return cls("pty", placed.pty)
        return cls("rtu_tcp", placed.rtu_tcp) if placed.tcp is None else cls("tcp", placed.tcp)

    def __str__(self) -> str:
        return f"--{self.kind.replace('_', '-')} {self.address or ''}".rstrip()


class Entrance(NamedTuple):
    """A door and the devices behind it."""

    door: Endpoint
    devices: tuple[SimulatedDevice, ...]

    def __str__(self) -> str:
        """The URL; behind it the names of the devices, where they have any."""
        return " ".join((self.door.url, *(device.name for device in self.devices if device.name)))


def open_entrances(
    placed: Sequence[tuple[SimulatedDevice, ListenAddress]],
    stack: ExitStack,
    tell: Callable[[str], None],
    *,
    line_speed: bool,
) -> list[Entrance]:
    """A door for every way in, closed by `stack`; `tell` gets a line when one is full.

    ConfigError when devices cannot share it, or it cannot be opened.
    """
    behind: dict[ListenAddress, list[SimulatedDevice]] = {}
    for device, way_in in placed:
        behind.setdefault(way_in, []).append(device)
    entrances = []
    for way_in, devices in behind.items():
        _check_units(way_in, devices)
        _check_speech(way_in, devices)
        ports = _ports_of(Line(devices))
        door = open_door(way_in, ports, _settings(way_in, devices), tell, line_speed=line_speed)
        stack.callback(door.close)
        entrances.append(Entrance(door, tuple(devices)))
    return entrances


def _check_units(way_in: ListenAddress, devices: Sequence[SimulatedDevice]) -> None:
    for at, device in enumerate(devices):
        for other in devices[:at]:
            if other.unit_id == device.unit_id:
                raise ConfigError(
                    f"{way_in}: '{other.name}' and '{device.name}' both have unit_id {device.unit_id}: give them "
                    "different ones, or ways in of their own"
                )


def _check_speech(way_in: ListenAddress, devices: Sequence[SimulatedDevice]) -> None:
    for device in devices:
        if not device.profile.has_registers and (way_in.kind == "tcp" or len(devices) > 1):
            raise ConfigError(
                f"{way_in}: '{device.profile.profile.id}' speaks no Modbus: serve it alone, with --pty PATH or "
                "--rtu-tcp HOST:PORT"
            )


def open_door(
    way_in: ListenAddress,
    new_port: Callable[[bool], Port],
    settings: SerialSettings | None,
    tell: Callable[[str], None],
    *,
    line_speed: bool,
) -> Endpoint:
    """The door to ports that `new_port(numbered)` makes, on a line set like `settings`, as slow as it or not."""
    if way_in.kind == "tcp":
        if line_speed:
            raise ConfigError(
                "--line-speed: Modbus TCP has no serial line; serve a device that has one with --pty or --rtu-tcp"
            )
        return TcpEndpoint(way_in.address or "0", "tcp", lambda: new_port(True), tell)

    def rtu_port() -> Port:
        port = new_port(False)
        return SlowLine(port, settings) if line_speed and settings is not None else port

    if way_in.kind == "rtu_tcp":
        return TcpEndpoint(way_in.address or "0", "rtu+tcp", rtu_port, tell)
    return Terminal(None if way_in.address is None else Path(way_in.address), rtu_port())


def _ports_of(line: Line) -> Callable[[bool], Port]:
    return lambda numbered: line.new_port(numbered=numbered)


def _settings(way_in: ListenAddress, devices: Sequence[SimulatedDevice]) -> SerialSettings | None:
    """How the line is set; of devices that leave the factory with different settings, as the first one."""
    if way_in.kind == "tcp":
        return None
    for device in devices:
        if device.profile.serial_settings() is None:
            raise ConfigError(f"'{device.profile.profile.id}' has no serial line: serve it with --tcp HOST:PORT")
    return devices[0].profile.serial_settings()
