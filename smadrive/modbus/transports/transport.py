"""The interface of a transport, which carries bytes to a bus and back.

A transport has a clock. The client sets deadlines by this clock, and the transport waits by it: real time on a serial
port, virtual time in process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, Self

from smadrive.clock import Clock
from smadrive.modbus.framing.framing import Framing

Parity = Literal["N", "E", "O"]
PortAccess = Callable[[], None]
"""Called by `write` and `reopen` before they begin, and by `read` before it waits and before it reads bytes.

It raises an error when another process uses the port now.
"""


class Transport(Protocol):
    """A connection to a bus. `write`, `read` and `discard` raise TransportError when the connection is lost."""

    @property
    def clock(self) -> Clock:
        """The clock by which the client sets its deadlines."""
        ...

    @property
    def name(self) -> str:
        """The name of the connection in error messages."""
        ...

    @property
    def baudrate(self) -> int | None:
        """Bits per second, from which the client derives pauses and deadlines; None where there is no serial line."""
        ...

    @property
    def latency_s(self) -> float:
        """The longest time in seconds by which the connection delays a reply; added to the response timeout."""
        ...

    @property
    def reconnects(self) -> bool:
        """True for a socket, which may be dead without a sign: a missed deadline leads to a new connection."""
        ...

    @property
    def framing(self) -> Framing:
        """The framing of requests and replies."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        ...

    def read(self, deadline_s: float) -> bytes:
        """Return bytes as soon as any have arrived; return b"" if none have arrived at `deadline_s`."""
        ...

    def discard(self) -> bytes:
        """Remove and return the bytes that have arrived, without waiting."""
        ...

    @property
    def lost(self) -> bool:
        """True if the connection is closed, so that no byte can pass before `reopen`."""
        ...

    def disconnect(self) -> None:
        """Close the connection and drop the bytes that were not read. `reopen` opens it again."""
        ...

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again before `deadline_s`; TransportError when that fails, or after `close`."""
        ...

    def close(self) -> None:
        """Close the connection for good. A second call does nothing."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """Settings of a serial line; RTU always has 8 data bits."""

    baudrate: int = 115200
    parity: Parity = "N"
    stopbits: Literal[1, 2] = 1

    def __str__(self) -> str:
        """Return the settings in the usual short form, such as 9600 8N2."""
        return f"{self.baudrate} 8{self.parity}{self.stopbits}"
