"""Listen addresses, which an option or a sim file gives, and the endpoints at these addresses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

from firmware_sim.bus.line_speed import SlowLine
from firmware_sim.bus.ports import Port, RawPort
from firmware_sim.config import DeviceEntry
from firmware_sim.server.endpoint import Endpoint
from firmware_sim.server.pty_endpoint import PtyEndpoint
from firmware_sim.server.tcp_endpoint import TcpEndpoint
from smadrive.errors import ConfigError
from smadrive.modbus.transports.transport import SerialSettings

AddressKind = Literal["pty", "tcp", "rtu_tcp"]


class ListenAddress(NamedTuple):
    """The address at which clients reach a device: a pseudo-terminal, with or without a path, or a TCP address."""

    kind: AddressKind
    address: str | None = None

    @classmethod
    def of(cls, device: DeviceEntry) -> ListenAddress:
        """Return the listen address of an entry of `[[devices]]`."""
        if device.pty is not None:
            return cls("pty", device.pty)
        return cls("rtu_tcp", device.rtu_tcp) if device.tcp is None else cls("tcp", device.tcp)

    def __str__(self) -> str:
        return f"--{self.kind.replace('_', '-')} {self.address or ''}".rstrip()


def open_endpoint(
    address: ListenAddress,
    new_port: Callable[[bool], Port],
    settings: SerialSettings | None,
    log: Callable[[str], None],
    *,
    line_speed: bool,
) -> Endpoint:
    """Open an endpoint at `address` and return it.

    `new_port(numbered)` makes a port of the endpoint; `numbered` is True for Modbus TCP frames. `settings` are the
    settings of the serial line. With `line_speed`, replies arrive no faster than the baud rate allows. `log` gets a
    line when clients are rejected. ConfigError when the endpoint cannot be opened, and for `line_speed` with Modbus
    TCP.
    """
    if address.kind == "tcp":
        if line_speed:
            raise ConfigError(
                "Modbus TCP has no serial line",
                where="--line-speed",
                cure="serve the device with --pty or --rtu-tcp",
            )
        return TcpEndpoint(address.address or "0", "tcp", lambda: new_port(True), log)

    def rtu_port() -> Port:
        port = new_port(False)
        if not line_speed or settings is None or isinstance(port, RawPort):  # a raw port delays replies
            return port
        return SlowLine(port, settings)

    if address.kind == "rtu_tcp":
        return TcpEndpoint(address.address or "0", "rtu+tcp", rtu_port, log)
    return PtyEndpoint(None if address.address is None else Path(address.address), rtu_port())
