"""The common part of the serial and the TCP transport: plain system calls on a file descriptor.

pyserial is not used for reads and writes: it takes its timeout from an attribute, and setting this attribute
reprograms the port. A lost connection is closed at once. If the port stayed open, a USB adapter that is plugged in
again would get another name. `reopen` opens the connection again.

A signal may interrupt the opening or the closing of a connection at any line. So an interrupted opening leaves the
connection lost, and `disconnect` closes the port even then: otherwise a lock, or the only connection that a gateway
accepts, would stay with a port that no transport uses.

A forked child closes its copies of the connections. Otherwise a device that accepts only one client would stay
occupied after the end of the driver.
"""

from __future__ import annotations

import os
import select
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import ClassVar, NoReturn, Protocol, Self
from weakref import WeakSet

from smadrive.clock import MonotonicClock
from smadrive.errors import TransportError
from smadrive.modbus.framing.framing import Framing
from smadrive.modbus.transports.transport import PortAccess
from smadrive.posix import released_in_children

_CHUNK = 512
_MOST_READS = 64
"""`discard` reads at most this number of chunks."""
_GONE = -1


class Port(Protocol):
    """A port or socket of the operating system, in non-blocking mode as soon as it is open."""

    def close(self) -> None:
        """Close the port or socket. A second call does nothing."""
        ...


class DescriptorTransport(ABC):
    """A transport over a file descriptor. A subclass opens the descriptor.

    end                   reason in the error when the connection has ended
    cure                  cure in the error when the connection is lost
    reconnects            True if a connection is closed after a missed deadline, because it may be dead
    empty_reads_at_end    number of empty reads in a row after which the connection has ended
    port_access           see `PortAccess`; if it raises, nothing is sent and no byte that has arrived is returned
    """

    end: ClassVar[str]
    cure: ClassVar[str]
    reconnects: ClassVar[bool]
    empty_reads_at_end: ClassVar[int] = 1
    port_access: PortAccess | None = None
    _port: Port | None = None

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
        try:
            self._open(timeout_s)
            _transports.add(self)
        except BaseException:
            self.close()
            raise

    @abstractmethod
    def _open_port(self, timeout_s: float) -> int:
        """Open the port within `timeout_s` and return its descriptor; TransportError when it cannot be opened.

        Set `_port` before the port is open, so that `disconnect` can close the port after an interruption.
        """

    @property
    def lost(self) -> bool:
        """True if the connection is closed, so that no byte can pass before `reopen`."""
        return self._descriptor == _GONE

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again; TransportError when that fails, or after `close`."""
        if self._closed:
            raise TransportError("the connection is closed", where=self.name, cure="open a new connection")
        self._check_access()
        self.disconnect()
        self._open(max(deadline_s - self.clock.now_s(), 0.0))

    def write(self, data: bytes) -> None:
        """Send all of `data`; TransportError when the connection is lost or accepts only a part of the bytes."""
        self._check_access()
        try:
            sent = os.write(self._descriptor, data)
        except OSError as error:
            self._fail(error)
        if sent < len(data):
            self.disconnect()
            raise TransportError(
                "accepted only a part of the bytes",
                where=self.name,
                value=f"{sent} of {len(data)} bytes",
                cure="check whether the device or the adapter is stuck",
            )

    def read(self, deadline_s: float) -> bytes:
        """Return bytes as soon as any have arrived; return b"" if none have arrived at `deadline_s`."""
        self._check_access()
        if self.lost:
            self._fail(OSError("closed"))
        empty_reads = 0
        try:
            while self._is_readable(deadline_s):
                self._check_access()
                with suppress(BlockingIOError):  # the bytes were flushed between poll and read
                    if data := os.read(self._descriptor, _CHUNK):
                        return data
                    empty_reads += 1
                    if empty_reads == self.empty_reads_at_end:
                        self._fail(OSError(self.end))
        except OSError as error:
            self._fail(error)
        return b""

    def _is_readable(self, deadline_s: float) -> bool:
        """Return True as soon as a byte arrives or the connection ends; return False at `deadline_s`."""
        remaining_s = max(deadline_s - self.clock.now_s(), 0.0)
        return bool(self._poll.poll(remaining_s * 1e3))

    def discard(self) -> bytes:
        """Remove and return the bytes that have arrived, without waiting.

        Return at most `_MOST_READS` chunks: a faulty device may send without end.
        """
        discarded = b""
        for _ in range(_MOST_READS):
            if not (data := self.read(0.0)):
                break
            discarded += data
        return discarded

    def disconnect(self) -> None:
        """Close the connection and drop the bytes that were not read. `reopen` opens it again."""
        self._close_port()

    def close(self) -> None:
        """Close the connection for good. A second call does nothing."""
        self._closed = True
        self.disconnect()

    def close_inherited(self) -> None:
        """Close the connection for good in a forked child. The lock of the port stays with the parent."""
        self._closed = True
        self._close_port()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _check_access(self) -> None:
        if self.port_access is not None:
            self.port_access()

    def _open(self, timeout_s: float) -> None:
        descriptor = self._open_port(timeout_s)
        self._poll = select.poll()  # select() cannot handle a descriptor above 1023
        self._poll.register(descriptor, select.POLLIN)
        self._descriptor = descriptor

    def _close_port(self) -> None:
        self._descriptor = _GONE
        if self._port is not None:
            with suppress(OSError):
                self._port.close()

    def _fail(self, error: Exception) -> NoReturn:
        self.disconnect()
        raise TransportError("the connection is lost", where=self.name, value=error, cure=self.cure) from None


_transports: WeakSet[DescriptorTransport] = released_in_children(lambda one: one.close_inherited())
