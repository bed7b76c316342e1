"""A TCP connection as a transport: Modbus TCP, or RTU frames through a serial-to-network gateway."""

from __future__ import annotations

import select
import socket
from typing import NoReturn, Self

from smadrive.clock import MonotonicClock
from smadrive.errors import TransportError
from smadrive.modbus.framing import Framing

CONNECT_TIMEOUT_S = 3.0
_CHUNK = 512


class SocketTransport:
    """An open connection to `host`:`port`."""

    def __init__(self, host: str, port: int, framing: Framing, baudrate: int | None) -> None:
        """Connect; `baudrate` is that of a serial line behind a gateway, None where there is none.

        TransportError tells whether the host is unknown, refuses or is silent, and the cure.
        """
        self.clock = MonotonicClock()
        self.name = f"{host}:{port}"
        self.framing = framing
        self.baudrate = baudrate
        try:
            self._socket = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
        except OSError as error:
            raise TransportError(_cure(self.name, host, error)) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # a request is a packet, at once
        self._socket.setblocking(False)

    def write(self, data: bytes) -> None:
        """Send all of `data`; TransportError when the connection is gone or takes no more."""
        try:
            sent = self._socket.send(data)
        except OSError as error:
            self._lost(error)
        if sent < len(data):
            raise TransportError(
                f"{self.name}: the connection took {sent} of {len(data)} bytes: does the far end hang?"
            )

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s`."""
        try:
            remaining_s = max(deadline_s - self.clock.now_s(), 0.0)
            ready, _, _ = select.select((self._socket,), (), (), remaining_s)
            if not ready:
                return b""
            data = self._socket.recv(_CHUNK)
        except (OSError, ValueError) as error:  # ValueError: select on a closed socket
            self._lost(error)
        if not data:
            self._lost(OSError("closed by the far end"))
        return data

    def discard(self) -> int:
        """Throw away what has arrived; the number of bytes."""
        discarded = 0
        while data := self.read(self.clock.now_s()):
            discarded += len(data)
        return discarded

    def close(self) -> None:
        """Close the connection; closing twice does no harm."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _lost(self, error: Exception) -> NoReturn:
        raise TransportError(
            f"{self.name}: the connection is lost ({error}): is the device powered, does another client hold it?"
        ) from None


def _cure(name: str, host: str, error: OSError) -> str:
    """Why the connection does not open, and what to do about it."""
    if isinstance(error, socket.gaierror):
        return f"{name}: no host of the name '{host}' is known; write its address, as in tcp://192.168.1.10:502"
    if isinstance(error, ConnectionRefusedError):
        return f"{name}: refused: nobody listens there; check the port, and that Modbus TCP is switched on"
    if isinstance(error, TimeoutError):
        return f"{name}: no answer within {CONNECT_TIMEOUT_S:g} s: is the device powered and on this network?"
    return f"{name}: cannot be reached ({error}): check address and network"
