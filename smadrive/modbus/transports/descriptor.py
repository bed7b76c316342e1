"""What a serial port and a socket have in common: a descriptor, through which bytes move by plain system calls.

No library's own read meets an absolute deadline as cheaply: pyserial takes its timeout from an attribute whose change
reprograms the port. A connection that is lost is let go at once (a USB adapter gets its old name back only then) and
can be opened again.
"""

from __future__ import annotations

import os
import select
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import ClassVar, NoReturn, Protocol, Self

from smadrive.clock import MonotonicClock
from smadrive.errors import TransportError
from smadrive.modbus.framing.framing import Framing
from smadrive.modbus.transports.transport import PortAccess

_CHUNK = 512
_GONE = -1


class OpenPort(Protocol):
    """What the operating system opened, in non-blocking mode."""

    def fileno(self) -> int:
        """The descriptor."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...


class DescriptorTransport(ABC):
    """A transport over a descriptor; a subclass says how it is opened and what a loss may come from.

    With a `port_access` that has run out nothing is sent, and nothing that has arrived is taken for an answer.
    """

    end: ClassVar[str]
    suspicion: ClassVar[str]
    reconnects: ClassVar[bool]
    empty_reads_at_end: ClassVar[int] = 1
    port_access: PortAccess | None = None

    def __init__(
        self, name: str, framing: Framing, baudrate: int | None, timeout_s: float, latency_s: float = 0.0
    ) -> None:
        self.clock = MonotonicClock()
        self.name = name
        self.framing = framing
        self.baudrate = baudrate
        self.latency_s = latency_s
        self._closed = False
        self._descriptor = _GONE
        self._open(timeout_s)

    @abstractmethod
    def _open_port(self, timeout_s: float) -> OpenPort:
        """Open it within `timeout_s`; TransportError tells why it cannot be opened, and the cure."""

    @property
    def lost(self) -> bool:
        """Whether nothing can pass before `reopen`."""
        return self._descriptor == _GONE

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again; TransportError when it is still gone, or was closed on purpose."""
        if self._closed:
            raise TransportError(f"{self.name}: the connection is closed: open a new one")
        self._hold()
        self.disconnect()
        self._open(max(deadline_s - self.clock.now_s(), 0.0))

    def write(self, data: bytes) -> None:
        """Send all of `data`; TransportError when the connection is gone or takes no more."""
        self._hold()
        try:
            sent = os.write(self._descriptor, data)
        except OSError as error:
            self._fail(error)
        if sent < len(data):
            self.disconnect()
            raise TransportError(f"{self.name}: took {sent} of {len(data)} bytes: is the far end or the adapter stuck?")

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s`."""
        self._hold()
        if self.lost:
            self._fail(OSError("closed"))
        empty_reads = 0
        try:
            while self._is_readable(deadline_s):
                self._hold()
                with suppress(BlockingIOError):  # flushed between the two calls
                    if data := os.read(self._descriptor, _CHUNK):
                        return data
                    empty_reads += 1
                    if empty_reads == self.empty_reads_at_end:
                        self._fail(OSError(self.end))
        except OSError as error:
            self._fail(error)
        return b""

    def _is_readable(self, deadline_s: float) -> bool:
        """Whether something has arrived, or the connection has ended, before `deadline_s`."""
        remaining_s = max(deadline_s - self.clock.now_s(), 0.0)
        return bool(self._poll.poll(remaining_s * 1e3))

    def discard(self) -> bytes:
        """Take away what has arrived, without waiting."""
        discarded = b""
        while data := self.read(0.0):
            discarded += data
        return discarded

    def disconnect(self) -> None:
        """Let the connection go; what is on its way is gone."""
        if self._descriptor != _GONE:
            self._poll.unregister(self._descriptor)
            self._descriptor = _GONE
            self._held.close()

    def close(self) -> None:
        """Close for good; closing twice does no harm."""
        self._closed = True
        self.disconnect()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _hold(self) -> None:
        if self.port_access is not None:
            self.port_access()

    def _open(self, timeout_s: float) -> None:
        self._held = self._open_port(timeout_s)
        self._descriptor = self._held.fileno()
        self._poll = select.poll()  # select knows no descriptor above 1023
        self._poll.register(self._descriptor, select.POLLIN)

    def _fail(self, error: Exception) -> NoReturn:
        self.disconnect()
        raise TransportError(f"{self.name}: the connection is lost ({error}): {self.suspicion}") from None
