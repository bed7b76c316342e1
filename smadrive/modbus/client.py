"""The one client of a bus: one request, one reply, an absolute deadline. It reads and writes; protocol.py judges.

Before a request the connection is open (a lost one is opened anew), silent for the standard's pause, and empty: bytes
that arrived before the request answer nothing and are discarded. On RTU a failure is followed by a quarantine: nothing
is sent before the bus has been silent for one response timeout. Where an outstanding reply could be mistaken for the
answer, a probe goes first: a read whose reply looks different. A device answers in order, so nothing older can follow
the probe's reply.

A socket that missed a deadline may be dead without a sign (its gateway restarted, a router forgot it), so it is dropped
and opened anew. A device on a new connection may be another one: `connection` is another number then, and a request can
be bound to the number that its sender knows.

A trace sees every frame after it has passed. One that fails is ended and keeps no frame from passing.
"""

from __future__ import annotations

from threading import Lock

from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, SmadriveError, TransportError
from smadrive.modbus.bus import NEVER_SILENT_S, BusCounters, BusTiming, GuardedTrace, Trace, silence_s
from smadrive.modbus.failure import COUNTED, failure
from smadrive.modbus.framing import rtu
from smadrive.modbus.protocol import ClientProtocol
from smadrive.modbus.requests import Request
from smadrive.modbus.transports.transport import Transport
from smadrive.modbus.verdict import FINAL_CODES, ConnectionState, Outcome, Verdict

PROBES = 3
REOPENS_WITHIN_S = 0.5
"""One attempt to open a lost connection takes no longer."""
TURNAROUND_S = 0.1  # after a broadcast, serial line V1.02 section 2.4.1


class ModbusClient:
    """Sends requests to the devices of one bus, one at a time; threads wait for each other."""

    def __init__(self, transport: Transport, trace: Trace | None = None) -> None:
        """Take over `transport`; `trace(time_s, direction, bytes)` sees every byte that passes, a frame at a time."""
        self.transport = transport
        self.clock = transport.clock
        self.counters = BusCounters()
        self.trace = GuardedTrace(trace)
        self._protocol = ClientProtocol(transport.framing)
        self._tail_size = transport.framing.tail_size
        self._silence_s = silence_s(transport.baudrate) if transport.baudrate else 0.0
        self._character_s = 11 / transport.baudrate if transport.baudrate else 0.0
        self._free_at_s = self.clock.now_s()
        self._next_s: dict[int, float] = {}
        self._turn = Lock()
        self._heard = b""
        self._heard_s = 0.0

    @property
    def connection(self) -> int:
        """The number of the connection that the next request takes: a lost one is opened anew for it."""
        return self.counters.reopenings + self.transport.lost

    def execute(
        self,
        unit_id: int,
        request: Request,
        timing: BusTiming,
        connection: int | None = None,
        *,
        proved: bool = False,
    ) -> bytes:
        """The payload of the reply of `unit_id` to `request`, which goes out on this `connection` or not at all.

        `proved`: a request of another kind is answered first, so that not even the second copy of an earlier reply can
        be taken for this one; for reads that a safety decision rests on.

        DeadlineError, ProtocolError, ExceptionReply; TransportError when the connection is lost, or another one. Reads
        are retried after the first two.
        """
        retries = 0 if request.writes else timing.read_retries
        while True:
            try:
                with self._turn:
                    return self._transact_surely(unit_id, request, timing, connection, proved=proved)
            except (DeadlineError, ProtocolError):
                if retries == 0:
                    raise
                retries -= 1
                self.counters.retries += 1

    def broadcast(self, request: Request, timing: BusTiming) -> None:
        """Send a write to every device; none answers. Returns after the turnaround delay of the standard."""
        with self._turn:
            self._settle(rtu.BROADCAST, timing)
            self._write(self.transport.framing.request(rtu.BROADCAST, request.pdu))
            self.clock.sleep_until(self.clock.now_s() + TURNAROUND_S)

    def send_unconfirmed(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Send a request that must go out although nothing is answered; what comes of it stays outstanding.

        Nothing is sent through a connection that is lost.
        """
        with self._turn:
            if self.transport.lost:
                return
            self.clock.sleep_until(self._free_at_s + max(self._silence_s, timing.min_gap_s))
            self._write(self._protocol.send_unconfirmed(unit_id, request, self.clock.now_s()))
            self._free_at_s = self.clock.now_s() + timing.post_write_s

    def distrust(self) -> None:
        """For callers that find the last reply stale by its content: its request may still be answered."""
        self._protocol.distrust(self.clock.now_s())

    def _transact_surely(
        self, unit_id: int, request: Request, timing: BusTiming, connection: int | None, *, proved: bool
    ) -> bytes:
        self._settle(unit_id, timing)
        if self._protocol.needs_probe(unit_id, request, self.clock.now_s()):
            self._probe(unit_id, request, timing)
            self._settle(unit_id, timing)
        if proved:
            self._sync(unit_id, request, timing)
            self._settle(unit_id, timing)
        if connection not in (None, self.connection):
            raise TransportError(
                f"{self._who(unit_id, request)}: not sent, because the connection was opened anew and the device is "
                "not identified yet. Try again"
            )
        return self._transact(unit_id, request, timing)

    def _transact(self, unit_id: int, request: Request, timing: BusTiming) -> bytes:
        frame = self._protocol.send(unit_id, request)
        reply_size = 1 + len(request.reply_head) + request.payload_size + self._tail_size
        on_wire_s = (len(request.pdu) + 3 + reply_size) * self._character_s
        sent_s = self.clock.now_s()
        try:
            self._write(frame)
            outcome = self._outcome(sent_s + on_wire_s + self._patience_s(timing))
        except BaseException:  # Ctrl-C too leaves a reply on its way
            if self._protocol.state is ConnectionState.WAITING:
                self._protocol.give_up(self.clock.now_s())
            raise
        finally:
            self._told_received()
            now_s = self.clock.now_s()
            self._free_at_s = now_s + (timing.post_write_s if request.writes else 0.0)
            if timing.interval_s:
                self._next_s[unit_id] = now_s + timing.interval_s
            if self._protocol.state is ConnectionState.OUT_OF_STEP:
                self.transport.disconnect()
        if outcome.verdict is Verdict.ANSWERED:
            self.counters.replies += 1
            return outcome.data
        raise self._failure(outcome, unit_id, request)

    def _outcome(self, deadline_s: float) -> Outcome:
        """Read until the verdict is known: as soon as a byte is wrong, or at the deadline."""
        protocol, read = self._protocol, self.transport.read
        while data := read(deadline_s):
            self._heard_s = self.clock.now_s()
            if self.trace.active:
                self._heard += data
            outcome = protocol.receive(data, self._heard_s)
            if outcome is not None:
                return outcome
        return protocol.give_up(self.clock.now_s())

    def _failure(self, outcome: Outcome, unit_id: int, request: Request) -> SmadriveError:
        """The error that the verdict means, counted; a silent socket is dropped."""
        for counter in COUNTED[outcome.verdict]:
            setattr(self.counters, counter, getattr(self.counters, counter) + 1)
        if outcome.verdict is Verdict.SILENT and self.transport.reconnects:
            self.transport.disconnect()
        return failure(outcome, self._who(unit_id, request))

    def _write(self, frame: bytes) -> None:
        self._heard = b""
        self.counters.requests += 1
        now_s = self.clock.now_s()
        self.transport.write(frame)
        self.trace(now_s, "sent", frame)

    def _settle(self, unit_id: int, timing: BusTiming) -> None:
        """Return when the bus and the unit may be used: open, silent for long enough, and empty."""
        if self.transport.lost:
            self._reopen()
        gap_s = max(self._silence_s if timing.silence else 0.0, timing.min_gap_s)
        self.clock.sleep_until(max(self._free_at_s + gap_s, self._next_s.get(unit_id, 0.0)))
        if stray := self._discard():
            self._discarded(stray)
            self._protocol.stray(stray)
        if self._protocol.state is ConnectionState.OUT_OF_STEP:
            self.transport.disconnect()
            self._reopen()
        if self._protocol.state is ConnectionState.SUSPECT:
            self._quarantine(timing, silent_since_s=self.clock.now_s() if stray else self._free_at_s)

    def _discard(self) -> bytes:
        """What arrived before the request; a connection that has ended meanwhile is opened anew."""
        try:
            return self.transport.discard()
        except TransportError:
            if not self.transport.lost:
                raise
            self._reopen()
            return b""

    def _reopen(self) -> None:
        self.transport.reopen(self.clock.now_s() + REOPENS_WITHIN_S)
        self.counters.reopenings += 1
        self._protocol.new_connection()
        self._free_at_s = self.clock.now_s()

    def _patience_s(self, timing: BusTiming) -> float:
        return timing.response_timeout_s + self.transport.latency_s

    def _quarantine(self, timing: BusTiming, silent_since_s: float) -> None:
        """Listen until the bus has been silent for one response timeout."""
        self.counters.quarantines += 1
        quiet_s = max(self._patience_s(timing), self._silence_s)
        give_up_s = self.clock.now_s() + NEVER_SILENT_S + quiet_s
        while data := self.transport.read(silent_since_s + quiet_s):
            self._discarded(data)
            silent_since_s = self.clock.now_s()
            if silent_since_s > give_up_s:
                raise TransportError(
                    f"{self.transport.name}: the bus is never silent. Check that no other client talks on this line"
                )
        self._protocol.silence()

    def _discarded(self, data: bytes) -> None:
        self.counters.discarded_bytes += len(data)
        self.trace(self.clock.now_s(), "discarded", data)

    def _told_received(self) -> None:
        if self._heard:
            self.trace(self._heard_s, "received", self._heard)

    def _probe(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Ask for something else until its answer proves that no outstanding reply is left; raise why it does not."""
        failure: SmadriveError = ProtocolError(
            f"{self._who(unit_id, request)}: not sent, because a late reply to an earlier request could be taken for "
            "its answer. Wait 10 s, or restart the device"
        )
        for attempt in range(PROBES):
            probe = self._protocol.probe_request(unit_id, request, attempt, self.clock.now_s())
            if probe is None:
                break
            self.counters.probes += 1
            try:
                self._transact(unit_id, probe, timing)
            except (ProtocolError, ExceptionReply) as error:
                failure = error
            if not self._protocol.may_be_mistaken(unit_id, request, self.clock.now_s()):
                return
            self._settle(unit_id, timing)
        raise failure

    def _sync(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Get a request of another kind answered: no copy of an older reply can follow.

        A device that answers nothing but `request` stays silent, and the quarantine after that must do.
        """
        sync = self._protocol.sync_request(unit_id, request, self.clock.now_s())
        self.counters.probes += 1
        try:
            self._transact(unit_id, sync, timing)
        except ExceptionReply as refusal:
            if refusal.code not in FINAL_CODES:  # the real answer may still come: nothing is proved
                raise
        except DeadlineError:
            if not self._protocol.stays_silent(unit_id, sync):
                raise

    def _who(self, unit_id: int, request: Request) -> str:
        return f"{self.transport.name}, unit {unit_id}, function {request.function} at {request.address}"
