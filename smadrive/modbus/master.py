"""The one master of a bus: one request, one reply, nothing taken on trust.

A reply counts only if unit, function, byte count (or echo), length and CRC are those of the request; anything else is
a ProtocolError at once. Modbus TCP numbers its replies, and late ones are dropped by their number. RTU does not, so a
reply that comes after its deadline looks like the answer to the next request. Three things keep it from being taken
for one:

1. after a failure the bus is quarantined: nothing is sent before it has been silent, and what arrives is discarded;
2. a reply that is still owed is remembered. If the next request's right reply would look the same, a probe whose
   reply looks different goes first (a read that has worked before, if there is one); a device answers in order, so
   after the probe's reply nothing old can come;
3. bytes that nobody asked for, found before a request, also lead to quarantine, and so does a new connection: nobody
   knows what was asked through the one before it.

One thing no master of RTU can tell: a device that answers twice, the second time after the next request of the same
shape has gone out. Content tells it: a sequence number (`HeaterBoard.exchange`), the read-back (`Device.write`).

A lost connection is opened again by the next request, within that request's response timeout. Another device may be
found there: `connection` is another number then, and a request can be bound to the one that its sender knows.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import chain
from threading import Lock

from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import frames, requests
from smadrive.modbus.bus import EXCEPTIONS, NEVER_SILENT_S, BusCounters, BusTiming, Direction, Trace, silence_s
from smadrive.modbus.requests import Request
from smadrive.modbus.transport import Transport

Shape = tuple[int, bytes, int]  # unit, reply head, payload size: what tells a reply from the reply to another request

LATEST_REPLY_S = 10.0  # a reply that has not come by then is lost for good; longer than any latency
PROBES = 3
TURNAROUND_S = 0.1  # after a broadcast, serial line V1.02 section 2.4.1


class Master:
    """Sends requests to the devices of one bus, one at a time; threads wait for each other."""

    def __init__(self, transport: Transport, trace: Trace | None = None) -> None:
        """Take over `transport`; `trace(time_s, direction, bytes)` sees every byte that passes, a frame at a time."""
        self.transport = transport
        self.clock = transport.clock
        self.counters = BusCounters()
        self._trace = trace
        self._framing = transport.framing
        self._silence_s = silence_s(transport.baudrate) if transport.baudrate else 0.0
        self._character_s = 11 / transport.baudrate if transport.baudrate else 0.0
        self._free_at_s = self.clock.now_s()
        self._turn = Lock()
        self._suspect = not self._framing.numbered
        self._owed: dict[Shape, float] = {}
        self._proven: dict[Shape, Request] = {}
        self._heard = b""
        self._heard_s = 0.0

    @property
    def connection(self) -> int:
        """The number of the connection that the next request takes: a lost one is opened anew for it."""
        return self.counters.reopenings + self.transport.lost

    def execute(self, unit_id: int, request: Request, timing: BusTiming, connection: int | None = None) -> bytes:
        """The payload of the reply of `unit_id` to `request`, which goes out on this `connection` or not at all.

        DeadlineError, ProtocolError, ExceptionReply; TransportError when the connection is lost, or another one. Reads
        are retried after the first two.
        """
        retries = 0 if request.writes else timing.read_retries
        while True:
            try:
                with self._turn:
                    return self._transact_surely(unit_id, request, timing, connection)
            except (DeadlineError, ProtocolError):
                if retries == 0:
                    raise
                retries -= 1
                self.counters.retries += 1

    def broadcast(self, request: Request, timing: BusTiming) -> None:
        """Send a write to every device; nobody answers. Returns after the turnaround delay of the standard."""
        with self._turn:
            self._settle(timing)
            self._send(frames.BROADCAST, request)
            self.clock.sleep_until(self.clock.now_s() + TURNAROUND_S)

    def distrust(self) -> None:
        """Quarantine the bus before the next request: for callers that find a reply stale by its content."""
        self._suspect = True

    def _transact_surely(self, unit_id: int, request: Request, timing: BusTiming, connection: int | None) -> bytes:
        self._settle(timing)
        if self._owed and self._could_be_mistaken(unit_id, request):
            self._flush_owed(unit_id, request, timing)
            self._settle(timing)
        if connection not in (None, self.connection):
            raise TransportError(
                f"{self._who(unit_id, request)}: not sent: the connection was opened anew, and nobody knows yet who "
                "is there: try again"
            )
        return self._transact(unit_id, request, timing)

    def _transact(self, unit_id: int, request: Request, timing: BusTiming) -> bytes:
        reply_size = 1 + len(request.reply_head) + request.payload_size + self._framing.tail_size
        on_wire_s = (len(request.pdu) + 3 + reply_size) * self._character_s
        try:
            sent_s = self._send(unit_id, request)
            payload = self._receive(unit_id, request, reply_size, sent_s + on_wire_s + self._patience_s(timing))
        except ExceptionReply:
            raise
        except BaseException:  # Ctrl-C too leaves a reply on its way
            self._doubt(unit_id, request)
            raise
        finally:
            self._told("received", self._heard, self._heard_s)
            self._free_at_s = self.clock.now_s() + (timing.post_write_s if request.writes else 0.0)
        if self._owed:
            self._nothing_owed_by(unit_id)
        if not request.writes:
            self._proven[_shape(unit_id, request)] = request
        return payload

    def _doubt(self, unit_id: int, request: Request) -> None:
        """See to it that what has come or will come of a failed transaction is taken for nothing else."""
        if not self._framing.numbered:
            self._suspect = True
            self._owed[_shape(unit_id, request)] = self.clock.now_s() + LATEST_REPLY_S
        elif self._framing.out_of_step:
            self.transport.lose()

    def _send(self, unit_id: int, request: Request) -> float:
        frame = self._framing.request(unit_id, request.pdu)
        now_s = self.clock.now_s()
        if self._trace is not None:
            self._heard = b""
            self._trace(now_s, "sent", frame)
        self.counters.requests += 1
        self.transport.write(frame)
        return now_s

    def _receive(self, unit_id: int, request: Request, reply_size: int, deadline_s: float) -> bytes:
        """Collect the reply, refusing it as soon as a byte is wrong."""
        framing = self._framing
        right_head = bytes((unit_id,)) + request.reply_head
        reply = b""
        while True:
            reply = framing.reply(self._arrived(deadline_s, reply, unit_id, request))
            if reply.startswith(right_head):
                if len(reply) >= reply_size or framing.numbered:
                    whole = self._checked(reply, reply_size, unit_id, request)
                    return whole[len(right_head) : len(right_head) + request.payload_size]
            elif len(reply) >= 2 and reply[:2] == bytes((unit_id, request.function | 0x80)):
                if len(reply) >= 3 + framing.tail_size or framing.numbered:
                    self._refuse(self._checked(reply, 3 + framing.tail_size, unit_id, request)[2], unit_id, request)
            elif not right_head.startswith(reply) or (reply and framing.numbered):
                self.counters.wrong_replies += 1
                raise ProtocolError(
                    f"{self._who(unit_id, request)}: the reply starts {reply[: len(right_head)].hex(' ')}, "
                    f"the right one starts {right_head.hex(' ')}: discarded"
                )

    def _arrived(self, deadline_s: float, reply: bytes, unit_id: int, request: Request) -> bytes:
        data = self.transport.read(deadline_s)
        if not data:
            self.counters.timeouts += 1
            raise DeadlineError(
                f"{self._who(unit_id, request)}: {len(reply) or 'no'} bytes of the reply before the deadline: is the "
                "device powered, and are unit id, baud rate and parity right?"
            )
        if self._trace is not None:
            self._heard += data
            self._heard_s = self.clock.now_s()
        return data

    def _checked(self, reply: bytes, size: int, unit_id: int, request: Request) -> bytes:
        if len(reply) != size:
            self.counters.wrong_replies += 1
            raise ProtocolError(f"{self._who(unit_id, request)}: {len(reply)} bytes, the right reply has {size}")
        if not self._framing.intact(reply):
            self.counters.crc_errors += 1
            raise ProtocolError(f"{self._who(unit_id, request)}: wrong CRC: check cable, termination and baud rate")
        self.counters.replies += 1
        return reply

    def _refuse(self, code: int, unit_id: int, request: Request) -> None:
        self.counters.exceptions += 1
        meaning = EXCEPTIONS.get(code, "unknown")
        raise ExceptionReply(f"{self._who(unit_id, request)}: the device refuses: exception {code}, {meaning}", code)

    def _settle(self, timing: BusTiming) -> None:
        """Return when the bus may be used: open, silent for long enough, and empty."""
        if self.transport.lost:
            self._reopen(timing)
        gap_s = max(self._silence_s if timing.silence else 0.0, timing.min_gap_s)
        self.clock.sleep_until(self._free_at_s + gap_s)
        if self._framing.numbered:
            return
        stray = self.transport.discard()
        if stray:
            self._discarded(stray)
        if stray or self._suspect:
            self._quarantine(timing, silent_since_s=self.clock.now_s() if stray else self._free_at_s)

    def _reopen(self, timing: BusTiming) -> None:
        self.transport.reopen(self.clock.now_s() + timing.response_timeout_s)
        self.counters.reopenings += 1
        self._framing.restart()
        self._free_at_s = self.clock.now_s()
        self._suspect = not self._framing.numbered

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
                raise TransportError(f"{self.transport.name}: the bus is never silent: does another master talk?")
        self._suspect = False

    def _discarded(self, data: bytes) -> None:
        self.counters.discarded_bytes += len(data)
        self._told("discarded", data, self.clock.now_s())

    def _told(self, direction: Direction, data: bytes, time_s: float) -> None:
        if self._trace is not None and data:
            self._trace(time_s, direction, data)

    def _could_be_mistaken(self, unit_id: int, request: Request) -> bool:
        now_s = self.clock.now_s()
        self._owed = {shape: until_s for shape, until_s in self._owed.items() if until_s > now_s}
        return _shape(unit_id, request) in self._owed

    def _flush_owed(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Probe until the probe's own reply comes; a ProtocolError means that an owed one has come instead."""
        for attempt in range(1, PROBES + 1):
            try:
                self._probe(unit_id, request, timing)
            except ProtocolError:
                if attempt == PROBES:
                    raise
                self._settle(timing)
            else:
                return

    def _probe(self, unit_id: int, request: Request, timing: BusTiming) -> None:
        """Read something whose reply no owed reply resembles; its answer, even a refusal, proves the bus clean."""
        self.counters.probes += 1
        proven = (known for shape, known in self._proven.items() if shape[0] == unit_id)
        tries = (requests.read_holding(min(request.address, 0xFF00), count) for count in range(1, 126))
        probe = next((one for one in chain(proven, tries) if _shape(unit_id, one) not in self._owed), None)
        if probe is None:
            raise DeadlineError(
                f"unit {unit_id} owes too many replies: wait {LATEST_REPLY_S:g} s or restart the device"
            )
        with suppress(ExceptionReply):  # refused is answered
            self._transact(unit_id, probe, timing)
        self._nothing_owed_by(unit_id)

    def _nothing_owed_by(self, unit_id: int) -> None:
        """A device answers in order: it has answered a later request, so an older reply can no longer come."""
        self._owed = {shape: until_s for shape, until_s in self._owed.items() if shape[0] != unit_id}

    def _who(self, unit_id: int, request: Request) -> str:
        return f"{self.transport.name}, unit {unit_id}, function {request.function} at {request.address}"


def _shape(unit_id: int, request: Request) -> Shape:
    return unit_id, request.reply_head, request.payload_size
