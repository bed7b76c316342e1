"""The simulated device on a TCP port: any number of clients, each with its own stream of frames."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Sequence

from firmware_sim.doors import Heard, Talk
from firmware_sim.ports import Port
from smadrive.errors import ConfigError
from smadrive.numbertext import shortened

LOOPBACK = "127.0.0.1"
_CHUNK = 2048


class TcpDoor:
    """Listens on [HOST:]PORT (0: any free port), by default for programs on this machine alone."""

    def __init__(self, address: str, scheme: str, new_port: Callable[[], Port]) -> None:
        """ConfigError when the address makes no sense, or nobody may listen there."""
        self._address = _parsed(address)
        self._new_port = new_port
        self._clients: dict[int, _Client] = {}
        try:
            self.open()
        except OSError as error:
            raise ConfigError(
                f"--{scheme.replace('+', '-')} {address}: cannot listen there ({error.strerror})"
            ) from None
        self.url = f"{scheme}://{self._address[0]}:{self._address[1]}"

    def open(self) -> None:
        """Listen; when opened again, on the same port."""
        self._listener = socket.create_server(self._address)
        self._listener.setblocking(False)
        self._address = (self._address[0], self._listener.getsockname()[1])

    def descriptors(self) -> list[int]:
        """The listening socket and the clients'."""
        return [] if self._listener.fileno() < 0 else [self._listener.fileno(), *self._clients]

    def talks(self) -> Sequence[Talk]:
        """The clients."""
        return list(self._clients.values())

    def hear(self, descriptor: int) -> Heard | None:
        """Take what a client sent; let a new one in, or one that is done out."""
        if descriptor == self._listener.fileno():
            with contextlib.suppress(OSError):  # gone before it was let in
                client = _Client(self._listener.accept()[0], self._new_port())
                self._clients[client.connection.fileno()] = client
            return None
        talk = self._clients.get(descriptor)
        if talk is None:
            return None
        try:
            data = talk.connection.recv(_CHUNK)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if data:
            return Heard(talk, data)
        del self._clients[descriptor]
        talk.connection.close()
        return None

    def close(self) -> None:
        """Close every connection."""
        self._listener.close()
        for client in self._clients.values():
            client.connection.close()
        self._clients.clear()


class _Client:
    """One connection."""

    def __init__(self, connection: socket.socket, port: Port) -> None:
        self.port = port
        self.connection = connection
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setblocking(False)

    def send(self, reply: bytes) -> None:
        """Let `reply` go; a client that is gone, or takes nothing, loses it."""
        with contextlib.suppress(OSError):
            self.connection.send(reply)


def _parsed(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not (port.isascii() and port.isdecimal() and len(port) <= len("65535")) or int(port) > 0xFFFF:
        raise ConfigError(
            f"{shortened(address)} is no address to listen on; write HOST:PORT, or PORT for this machine alone"
        )
    return host or LOOPBACK, int(port)
