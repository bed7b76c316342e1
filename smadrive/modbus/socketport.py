"""A TCP connection as a transport: Modbus TCP, or RTU frames through a serial-to-network gateway."""

from __future__ import annotations

import socket

from smadrive.errors import TransportError
from smadrive.modbus.descriptor import DescriptorTransport
from smadrive.modbus.framing import Framing

CONNECT_TIMEOUT_S = 3.0
_SHORTEST_TIMEOUT_S = 1e-3  # 0 would mean not to wait for the far end at all


class SocketTransport(DescriptorTransport):
    """An open connection to `host`:`port`."""

    end = "closed by the far end"
    suspicion = "is the device powered, does another client hold it?"

    def __init__(self, host: str, port: int, framing: Framing, baudrate: int | None, latency_s: float = 0.0) -> None:
        """Connect; `baudrate` is that of a serial line behind a gateway, None where there is none.

        TransportError tells whether the host is unknown, refuses or is silent, and the cure.
        """
        self._address = (host, port)
        super().__init__(f"{host}:{port}", framing, baudrate, CONNECT_TIMEOUT_S, latency_s)

    def _channel(self, timeout_s: float) -> socket.socket:
        try:
            connection = socket.create_connection(self._address, max(timeout_s, _SHORTEST_TIMEOUT_S))
        except OSError as error:
            raise TransportError(_cure(self.name, self._address[0], timeout_s, error)) from None
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # a request is a packet, at once
        connection.setblocking(False)
        return connection


def _cure(name: str, host: str, timeout_s: float, error: OSError) -> str:
    """Why the connection does not open, and what to do about it."""
    if isinstance(error, socket.gaierror):
        return f"{name}: no host of the name '{host}' is known; write its address, as in tcp://192.168.1.10:502"
    if isinstance(error, ConnectionRefusedError):
        return f"{name}: refused: nobody listens there; check the port, and that Modbus TCP is switched on"
    if isinstance(error, TimeoutError):
        return f"{name}: no answer within {timeout_s:g} s: is the device powered and on this network?"
    return f"{name}: cannot be reached ({error}): check address and network"
