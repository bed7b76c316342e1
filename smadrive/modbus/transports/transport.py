"""The interface of a transport: bytes to a bus and back.

A transport has a clock, so that a deadline means the same to the transport that waits and to the client that set it:
real time on a serial port, virtual time in process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, Self

from smadrive.clock import Clock
from smadrive.modbus.framing.framing import Framing

Parity = Literal["N", "E", "O"]
PortAccess = Callable[[], None]
"""Called before and after every use of a connection; raises when another process uses the port now."""


class Transport(Protocol):
    """A connection as a client needs it. Every method raises TransportError when the connection is lost."""

    @property
    def clock(self) -> Clock:
        """The clock of its deadlines."""
        ...

    @property
    def name(self) -> str:
        """Its name in error messages."""
        ...

    @property
    def baudrate(self) -> int | None:
        """Bits per second, from which a client derives the standard's pauses; None where bytes take no time."""
        ...

    @property
    def latency_s(self) -> float:
        """Longest delay of a reply by the connection, on top of the device's response timeout."""
        ...

    @property
    def reconnects(self) -> bool:
        """Whether silence may mean a dead connection that must be opened anew: true for a socket."""
        ...

    @property
    def framing(self) -> Framing:
        """The frames of requests and replies."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        ...

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s` of the clock."""
        ...

    def discard(self) -> bytes:
        """Remove and return the bytes that have arrived, without waiting."""
        ...

    @property
    def lost(self) -> bool:
        """Whether nothing can pass before `reopen`."""
        ...

    def disconnect(self) -> None:
        """Close the connection; bytes on their way are gone."""
        ...

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again before `deadline_s` of the clock; TransportError when that fails."""
        ...

    def close(self) -> None:
        """Close for good; closing twice does no harm."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """Settings of a serial line; RTU always has 8 data bits."""

    baudrate: int = 115200
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1
