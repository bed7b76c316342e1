"""The line of one bus. It reopens a lost connection, keeps the pauses, sends requests, and reads until the deadline.

Before a request, the line discards and counts the bytes that have already arrived, because they cannot be its reply. On
RTU, a quarantine may follow: the line sends nothing until the bus has been silent for one response timeout. A
quarantine is necessary on a new connection, after a request that failed or was sent unconfirmed, and when bytes were
discarded. It fails if the bus is not silent in time for the request (`Transaction.retry_until_s`). `send_unconfirmed`
discards nothing and needs no quarantine; it waits only for the pause between frames.

A socket that missed a deadline may be dead without a sign: the gateway restarted, or a router dropped the connection
from its table. So the line closes the socket and opens a new one for the next request. A new connection may lead to
another device. Callers recognise a new connection by its number, `connection`.

A frame is traced after it was sent or received. A trace that fails gets no more frames, and the traffic continues.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from smadrive.errors import TransportError
from smadrive.modbus.bus import NEVER_SILENT_S, BusCounters, BusTiming, GuardedTrace, Trace, silence_s
from smadrive.modbus.framing import rtu
from smadrive.modbus.protocol import ClientProtocol
from smadrive.modbus.requests import Request
from smadrive.modbus.transports.transport import Transport
from smadrive.modbus.verdict import ConnectionState, Outcome, Verdict

REOPENS_WITHIN_S = 0.5
"""Time limit in seconds for opening a lost connection again."""
SHORT_FRAMES = 20
"""Number of characters of a request for a few registers and of its reply."""
TURNAROUND_S = 0.1  # pause after a broadcast: serial line V1.02, section 2.4.1


class Transaction(NamedTuple):
    """A request to one unit, and the timing of its device.

    No retry and no quarantine begins that a silent device would prolong beyond the time `retry_until_s` of the clock.
    """

    unit_id: int
    request: Request
    timing: BusTiming
    retry_until_s: float = inf


class BusLine:
    """Sends the requests of one client through `transport` and reads their replies; `protocol` judges the replies."""

    def __init__(self, transport: Transport, protocol: ClientProtocol, trace: Trace | None) -> None:
        self.clock = transport.clock
        self.counters = BusCounters()
        self.trace = GuardedTrace(trace)
        self._transport = transport
        self._protocol = protocol
        self._tail_size = transport.framing.tail_size
        self._silence_s = silence_s(transport.baudrate) if transport.baudrate else 0.0
        self._character_s = 11 / transport.baudrate if transport.baudrate else 0.0
        self._free_at_s = self.clock.now_s()
        self._next_s: dict[int, float] = {}
        self._received = b""
        self._received_s = 0.0

    @property
    def connection(self) -> int:
        """Number of the connection for the next request: count of reopenings, plus 1 while the connection is lost."""
        return self.counters.reopenings + self._transport.lost

    def attempt_s(self, timing: BusTiming) -> float:
        """Return the time in s of a request that a silent device does not answer: a pause, and a missed deadline."""
        on_wire_s = SHORT_FRAMES * self._character_s
        return max(self._gap_s(timing), timing.interval_s) + on_wire_s + self._patience_s(timing)

    def settle(self, transaction: Transaction) -> None:
        """Prepare the line for a request to the unit of `transaction`.

        Open a lost connection, keep the pauses, discard the bytes that have arrived, and keep a quarantine if one is
        necessary. TransportError when the connection cannot be opened, or when the bus is not silent in time.
        """
        unit_id, _, timing, retry_until_s = transaction
        if self._protocol.state is ConnectionState.WAITING:  # a signal interrupted the last exchange and its `give_up`
            self._protocol.give_up(self.clock.now_s())
        if self._transport.lost:
            self._reopen()
        self.clock.sleep_until(max(self._free_at_s + self._gap_s(timing), self._next_s.get(unit_id, 0.0)))
        if stray := self._discard():
            self._free_at_s = self.clock.now_s()
            self._count_discarded(stray)
            self._protocol.stray(stray)
        if self._protocol.state is ConnectionState.OUT_OF_STEP:
            self._transport.disconnect()
            self._reopen()
        if self._protocol.state is ConnectionState.SUSPECT:
            self._quarantine(timing, retry_until_s)

    def exchange(self, transaction: Transaction) -> Outcome:
        """Send the request, read until its outcome is known or its deadline has passed, and return the outcome.

        Time until the deadline = time of request and reply on the wire + response timeout of the device + latency of
        the connection. A socket is closed if no complete reply has arrived at the deadline.
        """
        unit_id, request, timing, _ = transaction
        reply_size = 1 + len(request.reply_head) + request.payload_size + self._tail_size
        on_wire_s = (len(request.pdu) + 3 + reply_size) * self._character_s
        sent_s = self.clock.now_s()
        try:
            self._write(self._protocol.send(unit_id, request))
            outcome = self._outcome(sent_s + on_wire_s + self._patience_s(timing))
        except BaseException:  # also after Ctrl-C the reply may still arrive
            if self._protocol.state is ConnectionState.WAITING:
                self._protocol.give_up(self.clock.now_s())
            raise
        finally:
            self._end_exchange(transaction)
        if outcome.verdict is Verdict.SILENT and self._transport.reconnects:
            self._transport.disconnect()
        return outcome

    def broadcast(self, request: Request, timing: BusTiming) -> None:
        """Send a write to all devices at once, and return after the turnaround delay of the standard."""
        self.settle(Transaction(rtu.BROADCAST, request, timing))
        self._write(self._transport.framing.request(rtu.BROADCAST, request.pdu))
        self.clock.sleep_until(self.clock.now_s() + TURNAROUND_S)

    def send_unconfirmed(self, transaction: Transaction) -> None:
        """Send a request without waiting for its reply. The reply counts as outstanding.

        Send nothing if the connection is known to be lost. Keep the pause between frames, but wait for nothing else.
        """
        unit_id, request, timing, _ = transaction
        if self._transport.lost:
            return
        self.clock.sleep_until(self._free_at_s + max(self._silence_s, timing.min_gap_s))
        self._write(self._protocol.send_unconfirmed(unit_id, request, self.clock.now_s()))
        self._free_at_s = self.clock.now_s() + timing.post_write_s

    def _outcome(self, deadline_s: float) -> Outcome:
        """Read until a byte is wrong, the reply is complete, or the deadline has passed; return the outcome."""
        protocol, read = self._protocol, self._transport.read
        while data := read(deadline_s):
            self._received_s = self.clock.now_s()
            if self.trace.active:
                self._received += data
            outcome = protocol.receive(data, self._received_s)
            if outcome is not None:
                return outcome
            if self._received_s >= deadline_s:  # foreign bytes may arrive without end
                break
        return protocol.give_up(self.clock.now_s())

    def _write(self, frame: bytes) -> None:
        self._received = b""
        self.counters.requests += 1
        now_s = self.clock.now_s()
        self._transport.write(frame)
        self.trace(now_s, "sent", frame)

    def _end_exchange(self, transaction: Transaction) -> None:
        """Trace the reply, record when the next request may follow, close a TCP stream after an incomplete frame."""
        unit_id, request, timing, _ = transaction
        if self._received:
            self.trace(self._received_s, "received", self._received)
        now_s = self.clock.now_s()
        self._free_at_s = now_s + (timing.post_write_s if request.writes else 0.0)
        if timing.interval_s:
            self._next_s[unit_id] = now_s + timing.interval_s
        if self._protocol.state is ConnectionState.OUT_OF_STEP:
            self._transport.disconnect()

    def _discard(self) -> bytes:
        """Remove and return the bytes that arrived before the request. If the connection has ended, open it again."""
        try:
            return self._transport.discard()
        except TransportError:
            if not self._transport.lost:
                raise
            self._reopen()
            return b""

    def _reopen(self) -> None:
        """Open a lost connection again.

        The state of the new connection is recorded before the connection is open, because a signal may interrupt this
        method at any line. So no device on the new connection counts as identified, and its bus never as silent.
        """
        opens_by_s = self.clock.now_s() + REOPENS_WITHIN_S
        self._free_at_s = opens_by_s
        self._protocol.new_connection()
        self.counters.reopenings += 1
        try:
            self._transport.reopen(opens_by_s)
        except BaseException:
            if self._transport.lost:
                self.counters.reopenings -= 1
            raise
        self._free_at_s = self.clock.now_s()

    def _gap_s(self, timing: BusTiming) -> float:
        return max(self._silence_s if timing.silence else 0.0, timing.min_gap_s)

    def _patience_s(self, timing: BusTiming) -> float:
        return timing.response_timeout_s + self._transport.latency_s

    def _quarantine(self, timing: BusTiming, retry_until_s: float) -> None:
        """Discard bytes until the bus has been silent for one response timeout.

        TransportError if bytes keep coming for `NEVER_SILENT_S`, or if a silent device would then not answer in time.
        """
        self.counters.quarantines += 1
        patience_s, now_s = self._patience_s(timing), self.clock.now_s()
        quiet_s = max(patience_s, self._silence_s)
        give_up_s = min(now_s + NEVER_SILENT_S + quiet_s, max(retry_until_s - patience_s, now_s))
        while self._free_at_s + quiet_s <= give_up_s:
            data = self._transport.read(self._free_at_s + quiet_s)
            if not data:
                self._protocol.silence()
                return
            self._count_discarded(data)
            self._free_at_s = self.clock.now_s()
        raise TransportError(
            "the bus is not silent",
            where=self._transport.name,
            cure="check that no other program uses this line",
        )

    def _count_discarded(self, data: bytes) -> None:
        self.counters.discarded_bytes += len(data)
        self.trace(self.clock.now_s(), "discarded", data)
