"""The interface of an endpoint, which is a pseudo-terminal or a TCP port where clients reach a simulated device.

An endpoint lists the file descriptors on which requests can arrive. Each client has a connection, which sends the
replies. An endpoint can be closed and opened again, like an adapter that is unplugged and plugged in.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from firmware_sim.bus.ports import Port


class EndpointConnection(Protocol):
    """The connection of one client. `port` takes the requests of the client, and `send` sends the replies."""

    port: Port

    def send(self, reply: bytes) -> None:
        """Send `reply`. The reply is lost when the client does not read."""
        ...


class Received(NamedTuple):
    """Bytes that arrived, and the connection on which they arrived."""

    connection: EndpointConnection
    data: bytes


class Endpoint(Protocol):
    """A place where clients connect. `url` is the address for a driver."""

    url: str

    def open(self) -> None:
        """Accept clients again after `close`."""
        ...

    def descriptors(self) -> list[int]:
        """The file descriptors to wait for."""
        ...

    def connections(self) -> Sequence[EndpointConnection]:
        """The open connections."""
        ...

    def receive(self, descriptor: int) -> Received | None:
        """Return the bytes that have arrived at `descriptor`, and their connection; None if no byte has arrived."""
        ...

    def close(self) -> None:
        """Close every connection, and accept no client until `open`."""
        ...
