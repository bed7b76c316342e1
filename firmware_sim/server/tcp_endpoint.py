"""The simulated device on a TCP port: up to `MOST_CLIENTS` clients, each with its own stream of frames.

A client too many is let in and closed at once, so that it learns of it. To be able to do so when the process has no
descriptor left, a door keeps one in reserve.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from collections.abc import Callable, Sequence

from firmware_sim.bus.ports import Port
from firmware_sim.server.endpoint import EndpointConnection, Heard
from smadrive.errors import ConfigError
from smadrive.files.number_text import shortened

LOOPBACK = "127.0.0.1"
MOST_CLIENTS = 64
"""Of one port. A real gateway has room for 1 to 32."""

_CHUNK = 2048


class TcpEndpoint:
    """Listens on [HOST:]PORT (0: any free port), by default for programs on this machine alone."""

    def __init__(self, address: str, scheme: str, new_port: Callable[[], Port], tell: Callable[[str], None]) -> None:
        """`tell` gets a line when clients are turned away, once.

        ConfigError when the address makes no sense, or nobody may listen there.
        """
        self._address = _parsed(address)
        self._new_port = new_port
        self._tell = tell
        self._has_told = False
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
        self._reserve = _Reserve()
        self._listener.setblocking(False)
        self._address = (self._address[0], self._listener.getsockname()[1])

    def descriptors(self) -> list[int]:
        """Those of the clients, then the listening socket: who leaves makes room for who comes."""
        return [] if self._listener.fileno() < 0 else [*self._clients, self._listener.fileno()]

    def talks(self) -> Sequence[EndpointConnection]:
        """The clients."""
        return list(self._clients.values())

    def hear(self, descriptor: int) -> Heard | None:
        """Take what a client sent; let a new one in, or one that is done out."""
        if descriptor == self._listener.fileno():
            self._let_in()
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

    def _let_in(self) -> None:
        """Take the next client, if there is room for it and it is still there."""
        try:
            connection, _ = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._turn_away("the process has no descriptor left")
            return
        if len(self._clients) >= MOST_CLIENTS:
            connection.close()
            self._tell_once(f"{MOST_CLIENTS} clients are connected, no more are let in")
            return
        with contextlib.suppress(OSError):  # gone before it was let in
            self._clients[connection.fileno()] = _Client(connection, self._new_port())

    def _turn_away(self, why: str) -> None:
        """Close a connection that there is no descriptor for, by means of the reserved one."""
        self._reserve.close()
        with contextlib.suppress(OSError):
            self._listener.accept()[0].close()
        self._reserve = _Reserve()
        self._tell_once(f"{why}, new clients are turned away")

    def _tell_once(self, what: str) -> None:
        if not self._has_told:
            self._has_told = True
            self._tell(f"{self.url}: {what}")

    def close(self) -> None:
        """Close every connection."""
        self._listener.close()
        self._reserve.close()
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


class _Reserve:
    """A descriptor that is kept free for a connection."""

    def __init__(self) -> None:
        self._taken = [os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)]

    def close(self) -> None:
        """Give it back; nothing happens the second time."""
        while self._taken:
            os.close(self._taken.pop())


def _parsed(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not (port.isascii() and port.isdecimal() and len(port) <= len("65535")) or int(port) > 0xFFFF:
        raise ConfigError(
            f"{shortened(address)} is no address to listen on; write HOST:PORT, or PORT for this machine alone"
        )
    return host or LOOPBACK, int(port)
