"""From devices to endpoints: devices with the same listen address share a line, and each line has one endpoint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from itertools import combinations
from typing import NamedTuple

from firmware_sim.bus.ports import Port
from firmware_sim.devices.device import Line, SimulatedDevice
from firmware_sim.server.endpoint import Endpoint
from firmware_sim.server.listen_address import ListenAddress, open_endpoint
from smadrive.errors import ConfigError
from smadrive.modbus.transports.transport import SerialSettings


class ServedLine(NamedTuple):
    """An endpoint, and the devices that clients reach at this endpoint."""

    endpoint: Endpoint
    devices: tuple[SimulatedDevice, ...]

    def __str__(self) -> str:
        """Return the URL, followed by the names of the devices that have a name."""
        return " ".join((self.endpoint.url, *(device.name for device in self.devices if device.name)))


def open_lines(
    devices: Sequence[tuple[SimulatedDevice, ListenAddress]],
    stack: ExitStack,
    log: Callable[[str], None],
    *,
    line_speed: bool,
) -> list[ServedLine]:
    """Open a line for every listen address, and return the lines; `stack` closes them.

    `log` gets a line when clients are rejected. ConfigError when devices cannot share an address, or an endpoint cannot
    be opened.
    """
    by_address: dict[ListenAddress, list[SimulatedDevice]] = {}
    for device, address in devices:
        by_address.setdefault(address, []).append(device)
    lines = []
    for address, sharing in by_address.items():
        _check_unit_ids(address, sharing)
        _check_protocol(address, sharing)
        new_port = _new_port_of(Line(sharing))
        endpoint = open_endpoint(address, new_port, _serial_settings(address, sharing), log, line_speed=line_speed)
        stack.callback(endpoint.close)
        lines.append(ServedLine(endpoint, tuple(sharing)))
    return lines


def _check_unit_ids(address: ListenAddress, devices: Sequence[SimulatedDevice]) -> None:
    for one, other in combinations(devices, 2):
        if one.unit_id == other.unit_id:
            raise ConfigError(
                f"'{one.name}' and '{other.name}' both have unit_id {one.unit_id}",
                where=address,
                cure="give them different unit ids, or different listen addresses",
            )


def _check_protocol(address: ListenAddress, devices: Sequence[SimulatedDevice]) -> None:
    for device in devices:
        if not device.profile.has_registers and (address.kind == "tcp" or len(devices) > 1):
            raise ConfigError(
                f"'{device.profile.profile.id}' does not speak Modbus",
                where=address,
                cure="serve it alone, with --pty PATH or --rtu-tcp HOST:PORT",
            )


def _new_port_of(line: Line) -> Callable[[bool], Port]:
    return lambda numbered: line.new_port(numbered=numbered)


def _serial_settings(address: ListenAddress, devices: Sequence[SimulatedDevice]) -> SerialSettings | None:
    """Return the settings of the serial line, taken from the first device; None for Modbus TCP.

    ConfigError for a device without a serial line.
    """
    if address.kind == "tcp":
        return None
    for device in devices:
        if device.profile.serial_settings() is None:
            raise ConfigError(
                f"'{device.profile.profile.id}' has no serial line", where=address, cure="serve it with --tcp HOST:PORT"
            )
    return devices[0].profile.serial_settings()
