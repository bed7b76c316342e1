"""Bytes to a bus and back, whatever carries them.

A transport brings its clock, so that a deadline means the same to the transport that waits and to the client that
set it: real time on a serial port, virtual time in process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, Self

from smadrive.clock import Clock
from smadrive.modbus.framing.framing import Framing

Parity = Literal["N", "E", "O"]
PortAccess = Callable[[], None]
"""Asked before and after every use of a connection: raises when it is another's now."""


class Transport(Protocol):
    """What a client needs of a connection. Every method raises TransportError when the connection is lost."""

    @property
    def clock(self) -> Clock:
        """The clock of its deadlines."""
        ...

    @property
    def name(self) -> str:
        """What error messages call it."""
        ...

    @property
    def baudrate(self) -> int | None:
        """Bits per second, from which a client derives the standard's pauses; None where bytes take no time."""
        ...

    @property
    def latency_s(self) -> float:
        """By how much the connection may delay a reply, beyond what the device may take."""
        ...

    @property
    def reconnects(self) -> bool:
        """Whether silence may mean a dead connection, which only a new one mends: so behind a socket."""
        ...

    @property
    def framing(self) -> Framing:
        """How requests and replies are packed."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        ...

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s` of the clock."""
        ...

    def discard(self) -> bytes:
        """Take away what has arrived, without waiting."""
        ...

    @property
    def lost(self) -> bool:
        """Whether nothing can pass before `reopen`."""
        ...

    def disconnect(self) -> None:
        """Let the connection go; what is on its way is gone."""
        ...

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again, before `deadline_s` of the clock or not at all."""
        ...

    def close(self) -> None:
        """Release the connection; closing twice does no harm."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """How a serial line is set; RTU always has 8 data bits."""

    baudrate: int = 115200
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1
