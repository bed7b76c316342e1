"""A TCP connection as a transport: Modbus TCP, or RTU frames through a serial-to-network gateway.

A TCP connection can be dead without a sign: the gateway restarted, a router forgot it. Three things end that:

- the client drops a socket that missed a deadline and opens another (`reconnects`);
- keep-alive and user timeout let the kernel find out about an idle one within `DEAD_AFTER_S`;
- a dropped socket is reset. A plain close would let the kernel send again what it had not delivered: a command to heat
  could arrive after the new connection has switched off.
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
"""How long the first connection is tried."""
ATTEMPT_S = 0.5
"""How long one attempt to connect takes at most."""
DEAD_AFTER_S = 2
"""After so long without an acknowledgement the kernel takes a connection for dead."""
_SHORTEST_TIMEOUT_S = 1e-3  # 0 would mean not to wait for the far end at all
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)
_OPTIONS = (
    (socket.IPPROTO_TCP, "TCP_NODELAY", 1),  # a request is a packet, at once
    (socket.SOL_SOCKET, "SO_KEEPALIVE", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPIDLE", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPINTVL", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPCNT", DEAD_AFTER_S),
    (socket.IPPROTO_TCP, "TCP_USER_TIMEOUT", 1000 * DEAD_AFTER_S),
)


class SocketTransport(DescriptorTransport):
    """An open connection to `host`:`port`."""

    end = "closed by the far end"
    suspicion = "is the device powered, does another client hold it?"
    reconnects = True

    def __init__(self, host: str, port: int, framing: Framing, baudrate: int | None, latency_s: float = 0.0) -> None:
        """Connect; `baudrate` is that of a serial line behind a gateway, None where there is none.

        TransportError tells whether the host is unknown, refuses or is silent, and the cure.
        """
        self._host = host
        self._address = (host, port)
        super().__init__(f"{host}:{port}", framing, baudrate, CONNECT_TIMEOUT_S, latency_s)

    def disconnect(self) -> None:
        """Let the connection go; unless it is closed on purpose, what it has not delivered yet is not sent again."""
        if not (self.lost or self._closed):
            with suppress(OSError):
                self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
        super().disconnect()

    def _open_port(self, timeout_s: float) -> socket.socket:
        give_up_s = time.monotonic() + timeout_s
        while True:
            left_s = max(min(give_up_s - time.monotonic(), ATTEMPT_S), _SHORTEST_TIMEOUT_S)
            try:
                self._connection = socket.create_connection(self._address, left_s)
            except OSError as error:
                if not isinstance(error, TimeoutError) or time.monotonic() >= give_up_s:
                    raise TransportError(_cure(self.name, self._host, timeout_s, error)) from None
            else:
                break
        self._address = self._connection.getpeername()[:2]  # the name server may be gone when it is opened anew
        for level, option, value in _OPTIONS:
            if hasattr(socket, option):
                self._connection.setsockopt(level, getattr(socket, option), value)
        self._connection.setblocking(False)
        return self._connection


def _cure(name: str, host: str, timeout_s: float, error: OSError) -> str:
    """Why the connection does not open, and what to do about it."""
    if isinstance(error, socket.gaierror):
        return f"{name}: no host of the name '{host}' is known. Write its address, as in tcp://192.168.1.10:502"
    if isinstance(error, ConnectionRefusedError):
        return f"{name}: refused: nobody listens there. Check the port, and that Modbus TCP is switched on"
    if isinstance(error, TimeoutError):
        return f"{name}: no answer within {timeout_s:g} s. Check that the device is powered and on this network"
    return f"{name}: cannot be reached ({error}). Check address and network"
