"""A simulated device on a TCP port: up to `MAX_CLIENTS` clients, each with its own stream of frames.

The endpoint accepts a client beyond this limit and closes the connection at once, so that the client notices the
rejection. Accepting needs a free file descriptor. So the endpoint keeps one descriptor in reserve, for the time when
the process has no other free descriptor.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from collections.abc import Callable, Sequence

from firmware_sim.bus.ports import Port
from firmware_sim.server.endpoint import EndpointConnection, Received
from smadrive.errors import ConfigError
from smadrive.files.number_text import shortened

LOOPBACK = "127.0.0.1"
MAX_CLIENTS = 64
"""The largest number of clients of one port at a time. Real gateways allow 1 to 32."""

_CHUNK = 2048


class TcpEndpoint:
    """Listens on [HOST:]PORT. Without HOST, only programs on this machine can connect. Port 0 picks a free port."""

    def __init__(self, address: str, scheme: str, new_port: Callable[[], Port], log: Callable[[str], None]) -> None:
        """Listen at `address`. `log` gets a line when a client is rejected for the first time, and no line later.

        ConfigError for an address of another form, and when listening at the address fails.
        """
        self._address = _parsed(address)
        self._new_port = new_port
        self._log = log
        self._has_logged = False
        self._connections: dict[int, _TcpConnection] = {}
        try:
            self.open()
        except OSError as error:
            raise ConfigError(
                f"cannot listen at this address ({error.strerror})",
                where=f"--{scheme.replace('+', '-')} {address}",
                cure="choose a free port of this machine",
            ) from None
        self.url = f"{scheme}://{self._address[0]}:{self._address[1]}"

    def open(self) -> None:
        """Listen. After `close` the endpoint listens on the same port again."""
        self._listener = socket.create_server(self._address)
        self._reserve = _ReservedDescriptor()
        self._listener.setblocking(False)
        self._address = (self._address[0], self._listener.getsockname()[1])

    def descriptors(self) -> list[int]:
        """Return the descriptors of the connections, then the descriptor of the listening socket.

        With this order, clients that leave are removed before new clients are accepted.
        """
        return [] if self._listener.fileno() < 0 else [*self._connections, self._listener.fileno()]

    def connections(self) -> Sequence[EndpointConnection]:
        """Return the connections of the clients."""
        return list(self._connections.values())

    def receive(self, descriptor: int) -> Received | None:
        """Return the bytes of a client, or None if no byte has arrived.

        A new client is accepted, and a client that has left is removed.
        """
        if descriptor == self._listener.fileno():
            self._accept()
            return None
        connection = self._connections.get(descriptor)
        if connection is None:
            return None
        try:
            data = connection.socket.recv(_CHUNK)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if data:
            return Received(connection, data)
        del self._connections[descriptor]
        connection.socket.close()
        return None

    def _accept(self) -> None:
        """Accept the next client, or reject it if there are too many clients. The client may have left already."""
        try:
            client, _ = self._listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._reject_next()
                self._log_once("the process has no descriptor left, new clients are rejected")
            return
        if len(self._connections) >= MAX_CLIENTS:
            client.close()
            self._log_once(f"{MAX_CLIENTS} clients are connected, new clients are rejected")
            return
        with contextlib.suppress(OSError):  # the client left before it was accepted
            self._connections[client.fileno()] = _TcpConnection(client, self._new_port())

    def _reject_next(self) -> None:
        """Accept and close the next client by means of the reserved descriptor."""
        self._reserve.close()
        with contextlib.suppress(OSError):
            self._listener.accept()[0].close()
        self._reserve = _ReservedDescriptor()

    def _log_once(self, text: str) -> None:
        if not self._has_logged:
            self._has_logged = True
            self._log(f"{self.url}: {text}")

    def close(self) -> None:
        """Stop listening, and close every connection."""
        self._listener.close()
        self._reserve.close()
        for connection in self._connections.values():
            connection.socket.close()
        self._connections.clear()


class _TcpConnection:
    """The TCP connection of one client."""

    def __init__(self, client: socket.socket, port: Port) -> None:
        self.port = port
        self.socket = client
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setblocking(False)

    def send(self, reply: bytes) -> None:
        """Send `reply`. The reply is lost if the client has left or does not read."""
        with contextlib.suppress(OSError):
            self.socket.send(reply)


class _ReservedDescriptor:
    """An open descriptor. When it is closed, the process can accept one more connection."""

    def __init__(self) -> None:
        self._held = [os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)]

    def close(self) -> None:
        """Release the descriptor. A second call does nothing."""
        while self._held:
            os.close(self._held.pop())


def _parsed(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not (port.isascii() and port.isdecimal() and len(port) <= len("65535")) or int(port) > 0xFFFF:
        raise ConfigError(
            "not a listen address", where=shortened(address), cure="write HOST:PORT, or PORT for this machine alone"
        )
    return host or LOOPBACK, int(port)
