"""A transport over a TCP connection: Modbus TCP, or RTU frames through a serial-to-network gateway.

A TCP connection can be dead without a sign: the gateway restarted, or a router dropped the connection from its table.
Three measures help:

- the client closes a socket that missed a deadline, and opens a new one (`reconnects`);
- with keep-alive and user timeout, the kernel detects a dead idle connection within `DEAD_AFTER_S`;
- a connection that is abandoned is reset. After a plain close the kernel would repeat undelivered bytes: a command to
  heat could arrive after a command on the new connection has switched the heater off.
"""

from __future__ import annotations

import socket
import struct
import time
from contextlib import suppress

from smadrive.errors import TransportError
from smadrive.modbus.framing.framing import Framing
from smadrive.modbus.transports.descriptor import DescriptorTransport

CONNECT_TIMEOUT_S = 3.0
"""Time limit in seconds for opening the first connection."""
ATTEMPT_S = 0.5
"""Time limit in seconds of one attempt to connect. Attempts are repeated until the time for opening is over."""
DEAD_AFTER_S = 2
"""Time in seconds without an acknowledgement, after which the kernel ends the connection."""
_SHORTEST_TIMEOUT_S = 1e-3  # a timeout of 0 would not wait at all
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)
_OPTIONS = (
    (socket.IPPROTO_TCP, "TCP_NODELAY", 1),  # send each request at once, in a packet of its own
    (socket.SOL_SOCKET, "SO_KEEPALIVE", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPIDLE", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPINTVL", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPCNT", DEAD_AFTER_S),
    (socket.IPPROTO_TCP, "TCP_USER_TIMEOUT", 1000 * DEAD_AFTER_S),
)


class SocketTransport(DescriptorTransport):
    """An open TCP connection to `port` of `host`, which carries the frames of `framing`."""

    end = "closed by the far end"
    cure = "check that the device is powered, and that no other client is connected to it"
    reconnects = True

    def __init__(self, host: str, port: int, framing: Framing, baudrate: int | None, latency_s: float = 0.0) -> None:
        """Connect to the host. `baudrate` belongs to the serial line behind a gateway; it is None for Modbus TCP.

        TransportError when the host is unknown, refuses the connection or does not answer.
        """
        self._host = host
        self._address = (host, port)
        super().__init__(f"{host}:{port}", framing, baudrate, CONNECT_TIMEOUT_S, latency_s)

    def disconnect(self) -> None:
        """Close the connection and drop undelivered bytes. (`close` instead lets the kernel deliver them.)"""
        if not (self.lost or self._closed):
            with suppress(OSError):
                self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
        super().disconnect()

    def _open_port(self, timeout_s: float) -> int:
        give_up_s = time.monotonic() + timeout_s
        while True:
            left_s = max(min(give_up_s - time.monotonic(), ATTEMPT_S), _SHORTEST_TIMEOUT_S)
            try:
                self._connect(left_s)
            except OSError as error:
                if not isinstance(error, TimeoutError) or time.monotonic() >= give_up_s:
                    raise _failure(self.name, self._host, timeout_s, error) from None
            else:
                break
        self._address = self._connection.getpeername()[:2]  # reopening must not need a name server
        for level, option, value in _OPTIONS:
            if hasattr(socket, option):
                self._connection.setsockopt(level, getattr(socket, option), value)
        self._connection.setblocking(False)
        return self._connection.fileno()

    def _connect(self, timeout_s: float) -> None:
        """Connect to the first address of the host that accepts; OSError of the last address if none accepts.

        A signal within `socket.create_connection` would leave an open socket that `disconnect` does not know.
        """
        failure = OSError("the host has no address")
        for family, kind, protocol, _, address in socket.getaddrinfo(*self._address, type=socket.SOCK_STREAM):
            self._port = self._connection = socket.socket(family, kind, protocol)
            self._connection.settimeout(timeout_s)
            try:
                self._connection.connect(address)
            except OSError as error:
                self._connection.close()
                failure = error
            else:
                return
        raise failure


def _failure(name: str, host: str, timeout_s: float, error: OSError) -> TransportError:
    """Return the error for a connection that cannot be opened."""
    if isinstance(error, socket.gaierror):
        return TransportError(
            "the name of the host is unknown",
            where=name,
            value=host,
            cure="write the address of the device, as in tcp://192.168.1.10:502",
        )
    if isinstance(error, ConnectionRefusedError):
        return TransportError(
            "the host refuses the connection, because no program listens on this port",
            where=name,
            cure="check the port, and that Modbus TCP is switched on",
        )
    if isinstance(error, TimeoutError):
        return TransportError(
            "no answer",
            where=name,
            limit=f"{timeout_s:g} s",
            cure="check that the device is powered and on this network",
        )
    return TransportError("cannot be reached", where=name, value=error, cure="check the address and the network")
