"""A transport without a port: it passes real frames to a simulated device in the same process.

The caller gives the clock. A virtual clock advances when the client waits for a reply. So timeouts, late replies and
watchdogs happen at exact times, without waiting in real time.
"""

from __future__ import annotations

import heapq
from typing import Protocol, Self

from smadrive.clock import Clock
from smadrive.errors import TransportError
from smadrive.modbus.framing.framing import Framing, RtuFraming, TcpFraming


class Peer(Protocol):
    """The simulated device at the other end."""

    def receive(self, data: bytes, time_s: float) -> list[tuple[float, bytes]]:
        """Take the bytes that arrive at `time_s`, and return the answers, each with the time of its arrival."""
        ...


class InProcessTransport:
    """A connection to `peer`. It imitates a serial line, or a TCP connection if `baudrate` is None."""

    def __init__(self, peer: Peer, clock: Clock, baudrate: int | None = 115200, latency_s: float = 0.0) -> None:
        """Connect to `peer`, which sets when bytes arrive. The client derives pauses and deadlines from `baudrate`."""
        self.clock = clock
        self.name = "in process"
        self.reconnects = False
        self.baudrate = baudrate
        self.latency_s = latency_s
        self.framing: Framing = TcpFraming() if baudrate is None else RtuFraming()
        self._peer = peer
        self._arriving: list[tuple[float, int, bytes]] = []
        self._order = 0
        self._lost = False
        self._closed = False
        self._return_s = 0.0

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` from the peer arrive at the time `due_s`. Drop `data` if the connection is lost."""
        if not self._lost:
            self._order += 1
            heapq.heappush(self._arriving, (due_s, self._order, data))

    def write(self, data: bytes) -> None:
        """Pass `data` to the peer; TransportError when the connection is lost or closed."""
        self._check_open()
        for due_s, answer in self._peer.receive(data, self.clock.now_s()):
            self.deliver(due_s, answer)

    def read(self, deadline_s: float) -> bytes:
        """Return bytes as soon as any have arrived; return b"" if none have arrived at `deadline_s`."""
        self._check_open()
        arriving = self._arriving
        if not arriving or arriving[0][0] > deadline_s:
            self.clock.sleep_until(deadline_s)
            return b""
        if arriving[0][0] > self.clock.now_s():
            self.clock.sleep_until(arriving[0][0])
        return heapq.heappop(arriving)[2]

    def discard(self) -> bytes:
        """Remove and return the bytes that have arrived, without waiting."""
        self._check_open()
        discarded = b""
        now_s = self.clock.now_s()
        while self._arriving and self._arriving[0][0] <= now_s:
            discarded += heapq.heappop(self._arriving)[2]
        return discarded

    @property
    def lost(self) -> bool:
        """True if the connection is closed, so that no byte can pass before `reopen`."""
        return self._lost

    def disconnect(self, return_s: float = 0.0) -> None:
        """Close the connection and drop the bytes that were not read.

        `reopen` fails before the time `return_s`, and before the later time of an earlier call.
        """
        self._lost = True
        self._return_s = max(self._return_s, return_s)
        self._arriving.clear()

    def reopen(self, _deadline_s: float) -> None:
        """Open a lost connection again; TransportError when the peer is still gone, or after `close`."""
        if self._closed:
            raise TransportError("the connection is closed", where=self.name, cure="open a new connection")
        if self.clock.now_s() < self._return_s:
            raise TransportError("the peer is still gone", where=self.name, limit=f"back at {self._return_s:g} s")
        self._lost = False

    def close(self) -> None:
        """Close the connection for good. A second call does nothing."""
        self.disconnect()
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._lost:
            raise TransportError("the connection is lost or closed", where=self.name, cure="open a new connection")
