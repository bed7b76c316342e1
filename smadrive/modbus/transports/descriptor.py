"""The common part of a serial port and a socket: a descriptor, through which bytes move by plain system calls.

A library's read meets an absolute deadline at a higher cost: pyserial takes its timeout from an attribute whose change
reprograms the port. A connection that is lost is closed at once, because a USB adapter gets its old name back only
then. It can be opened again.
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
    """A port or socket that the operating system has opened, in non-blocking mode."""

    def fileno(self) -> int:
        """The descriptor."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


class DescriptorTransport(ABC):
    """A transport over a descriptor; a subclass opens it, and names the end of it (`end`) and the cure of a loss.

    `port_access` is called before every use. When it raises, nothing is sent, and no byte that has arrived is returned.
    """

    end: ClassVar[str]
    cure: ClassVar[str]
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
        """Open it within `timeout_s`; TransportError with the reason and the cure when it cannot be opened."""

    @property
    def lost(self) -> bool:
        """Whether nothing can pass before `reopen`."""
        return self._descriptor == _GONE

    def reopen(self, deadline_s: float) -> None:
        """Open a lost connection again; TransportError when it is still gone, or was closed on purpose."""
        if self._closed:
            raise TransportError("the connection is closed", where=self.name, cure="open a new one")
        self._check_access()
        self.disconnect()
        self._open(max(deadline_s - self.clock.now_s(), 0.0))

    def write(self, data: bytes) -> None:
        """Send all of `data`; TransportError when the connection is gone or takes no more."""
        self._check_access()
        try:
            sent = os.write(self._descriptor, data)
        except OSError as error:
            self._fail(error)
        if sent < len(data):
            self.disconnect()
            raise TransportError(
                "took a part of the bytes only",
                where=self.name,
                value=f"{sent} of {len(data)} bytes",
                cure="check whether the device or the adapter is stuck",
            )

    def read(self, deadline_s: float) -> bytes:
        """Whatever has arrived, at least one byte; empty when nothing came before `deadline_s`."""
        self._check_access()
        if self.lost:
            self._fail(OSError("closed"))
        empty_reads = 0
        try:
            while self._is_readable(deadline_s):
                self._check_access()
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
        """Remove and return the bytes that have arrived, without waiting."""
        discarded = b""
        while data := self.read(0.0):
            discarded += data
        return discarded

    def disconnect(self) -> None:
        """Close the connection; bytes on their way are gone."""
        if self._descriptor != _GONE:
            self._poll.unregister(self._descriptor)
            self._descriptor = _GONE
            self._port.close()

    def close(self) -> None:
        """Close for good; closing twice does no harm."""
        self._closed = True
        self.disconnect()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _check_access(self) -> None:
        if self.port_access is not None:
            self.port_access()

    def _open(self, timeout_s: float) -> None:
        self._port = self._open_port(timeout_s)
        self._descriptor = self._port.fileno()
        self._poll = select.poll()  # select knows no descriptor above 1023
        self._poll.register(self._descriptor, select.POLLIN)

    def _fail(self, error: Exception) -> NoReturn:
        self.disconnect()
        raise TransportError("the connection is lost", where=self.name, value=error, cure=self.cure) from None
