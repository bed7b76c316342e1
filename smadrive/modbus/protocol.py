"""The client's side of Modbus without I/O: a request in, bytes in, a verdict out (the rules: verdict.py).

Two faults cannot be seen in a frame. On RTU, the second copy of a reply that arrives after the next request of the same
kind looks like the answer to it. On any connection, a gateway may answer with the reply to an older request.
`sync_request` gives a read whose answer is of a kind that has not arrived lately. Once it is answered, no copy can
follow, and no reply lags.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from math import inf

from smadrive.errors import ProtocolError
from smadrive.modbus import requests
from smadrive.modbus.framing.framing import Framing
from smadrive.modbus.outstanding import LATEST_REPLY_S, Kind, Outstanding, exception_kind, reply_kind
from smadrive.modbus.requests import Request
from smadrive.modbus.verdict import (
    CONSEQUENCES,
    FINAL_CODES,
    TRANSITIONS,
    VERDICTS,
    ConnectionEvent,
    ConnectionState,
    Outcome,
    Verdict,
)

FRESH = 16
"""A frame is new when its kind is not among so many last arrivals: no gateway lags by more replies."""
NEVER = -FRESH - 1

_FINAL = frozenset(bytes((code,)) for code in FINAL_CODES)


class ClientProtocol:
    """One connection's requests and replies, one at a time. Times are arguments; nothing is read or written here."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._outstanding = Outstanding()
        self._answered: dict[Kind, Request] = {}
        self._arrivals = 0
        self._arrived: dict[Kind, int] = {}
        self._arrived_s: dict[Kind, float] = {}
        self._silent: set[Kind] = set()
        self._unit_id = 0
        self._request = requests.read_holding(0, 1)
        self._head = self._exception_head = self._reply = b""
        self._size = 0
        self.state = ConnectionState.READY
        self._become(ConnectionEvent.NEW_CONNECTION)

    def new_connection(self) -> None:
        """Note a new connection: the requests that went through it before are unknown."""
        self._framing.restart()
        self._become(ConnectionEvent.NEW_CONNECTION)

    def stray(self, data: bytes) -> None:
        """Note that `data` arrived although no request is out: it answers nothing."""
        self._framing.skip(data)
        self._become(ConnectionEvent.STRAY)

    def silence(self) -> None:
        """Note that the bus has been silent for as long as a reply may take."""
        self._become(ConnectionEvent.SILENCE)

    def distrust(self, now_s: float) -> None:
        """Note that the content of the last reply proved it stale: the answer to its request may still arrive."""
        self._outstanding.add(reply_kind(self._unit_id, self._request), now_s)
        self._become(ConnectionEvent.FAILED)

    def send(self, unit_id: int, request: Request) -> bytes:
        """The frame to write; bytes that arrive from now on may be its answer."""
        self._become(ConnectionEvent.SENT)
        self._unit_id, self._request, self._reply = unit_id, request, b""
        self._head = bytes((unit_id,)) + request.reply_head
        self._exception_head = bytes((unit_id, request.function | 0x80))
        self._size = len(self._head) + request.payload_size + self._framing.tail_size
        return self._framing.request(unit_id, request.pdu)

    def send_unconfirmed(self, unit_id: int, request: Request, now_s: float) -> bytes:
        """The frame of a request that is sent without waiting; its answer stays outstanding."""
        self._outstanding.add(reply_kind(unit_id, request), now_s)
        self._outstanding.add(exception_kind(unit_id, request), now_s)
        self._become(ConnectionEvent.FAILED)
        return self._framing.request(unit_id, request.pdu)

    def receive(self, data: bytes, now_s: float) -> Outcome | None:
        """The outcome once `data` decides it, None while more may come."""
        try:
            self._reply = self._framing.reply(data)
        except ProtocolError:
            outcome: Outcome | None = Outcome(Verdict.MALFORMED, data)
        else:
            outcome = self._judged(self._reply, now_s)
        return None if outcome is None else self._concluded(outcome, now_s)

    def give_up(self, now_s: float) -> Outcome:
        """The outcome when the deadline has passed, or the wait was interrupted."""
        return self._concluded(Outcome(Verdict.SILENT, self._reply), now_s)

    def may_be_mistaken(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Whether an outstanding frame is of the kind of this request's reply; the request must not be sent then."""
        return bool(self._outstanding) and self._outstanding.holds(reply_kind(unit_id, request), now_s)

    def needs_probe(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Whether a probe goes first: a reply could be mistaken, or an exception could be an older one."""
        if self.may_be_mistaken(unit_id, request, now_s):
            return True
        doubtful = self._exception_is_doubtful(unit_id, request, now_s)
        return doubtful and next(self._clean(unit_id, request, self._known(unit_id), now_s), None) is not None

    def probe_request(self, unit_id: int, request: Request, attempt: int, now_s: float) -> Request | None:
        """A read whose reply differs from every outstanding frame, preferably one that was answered before.

        None when no such read exists, because too many replies of the unit are outstanding.
        """
        others = () if attempt == 0 else _other_functions(request)
        tries = chain(self._known(unit_id), others, _other_lengths(request))
        return next(self._clean(unit_id, request, tries, now_s), None)

    def sync_request(self, unit_id: int, request: Request, now_s: float) -> Request:
        """A read of another kind than `request`; its answer is of the kind that arrived longest ago, or never.

        A read that was answered before is taken if its kind has not been among the last `FRESH` arrivals.
        """
        known = list(self._clean(unit_id, request, self._known(unit_id), now_s))
        sure = min(known, key=lambda one: self._last_arrival(unit_id, one), default=None)
        if sure is not None and self._arrivals - self._last_arrival(unit_id, sure) > FRESH:
            return sure
        others = chain(islice(_other_lengths(request), FRESH), _other_functions(request))
        tries = [one for one in self._clean(unit_id, request, others, now_s) if self._may_answer(unit_id, one)]
        return min([*known, *tries], key=lambda one: self._last_arrival(unit_id, one), default=request)

    def stays_silent(self, unit_id: int, request: Request) -> bool:
        """Note that this sync was not answered; whether silence is normal: the unit never answered such a read."""
        self._silent.add(reply_kind(unit_id, request))
        return not any(request.pdu[:3] == one.pdu[:3] for kind, one in self._answered.items() if kind[0] == unit_id)

    def known_sync_request(self, unit_id: int, request: Request, now_s: float) -> Request | None:
        """The sync for a device that stays silent on what it does not know; None when it has answered nothing else.

        A read of another kind than `request` that this unit has answered before, the one that arrived longest ago.
        """
        known = self._clean(unit_id, request, self._known(unit_id), now_s)
        return min(known, key=lambda one: self._last_arrival(unit_id, one), default=None)

    def copy_may_follow(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Whether a second copy of an earlier reply of this kind may still arrive."""
        return now_s < self._arrived_s.get(reply_kind(unit_id, request), -inf) + LATEST_REPLY_S

    def _judged(self, reply: bytes, now_s: float) -> Outcome | None:
        if reply.startswith(self._head):
            return self._whole(reply, self._size, Verdict.ANSWERED, now_s)
        if reply.startswith(self._exception_head):
            arrived = Verdict.REFUSED if reply[2:3] in _FINAL else Verdict.DEFERRED
            return self._whole(reply, len(self._exception_head) + 1 + self._framing.tail_size, arrived, now_s)
        if not reply or (self._head.startswith(reply) and not self._framing.numbered):
            return None
        return Outcome(Verdict.FOREIGN, reply)

    def _whole(self, reply: bytes, size: int, arrived: Verdict, now_s: float) -> Outcome | None:
        """The outcome of a reply with the right head, once it has its `size`."""
        if len(reply) < size and not self._framing.numbered:
            return None
        if len(reply) != size:
            return Outcome(Verdict.WRONG_SIZE, reply)
        if not self._framing.intact(reply):
            return Outcome(Verdict.DAMAGED, reply)
        match VERDICTS[arrived, self._is_outstanding(arrived, now_s)]:
            case Verdict.ANSWERED:
                at = len(self._head)
                return Outcome(Verdict.ANSWERED, reply[at : at + self._request.payload_size])
            case verdict:
                return Outcome(verdict, reply, code=0 if arrived is Verdict.ANSWERED else reply[2])

    def _is_outstanding(self, arrived: Verdict, now_s: float) -> bool:
        """Whether the frame that arrived may belong to an earlier request."""
        if arrived is Verdict.ANSWERED:
            return self.may_be_mistaken(self._unit_id, self._request, now_s)
        return self._exception_is_doubtful(self._unit_id, self._request, now_s)

    def _exception_is_doubtful(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Whether an outstanding exception looks like this one. Transaction numbers exclude it for exceptions.

        They do not exclude it for replies: a gateway may number a late reply of its serial line.
        """
        if self._framing.numbered or not self._outstanding:
            return False
        return self._outstanding.holds(exception_kind(unit_id, request), now_s)

    def _concluded(self, outcome: Outcome, now_s: float) -> Outcome:
        consequence = CONSEQUENCES[outcome.verdict]
        if self._outstanding and consequence.proves:
            self._outstanding.clear(self._unit_id)
        if consequence.reply_remains:
            self._outstanding.add(reply_kind(self._unit_id, self._request), now_s)
        if consequence.exception_remains:
            self._outstanding.add(exception_kind(self._unit_id, self._request), now_s)
        self._note_arrival(outcome.verdict, now_s)
        if outcome.verdict is Verdict.ANSWERED and not self._request.writes:
            self._answered[reply_kind(self._unit_id, self._request)] = self._request
        if self._framing.numbered:
            self._framing.skip(b"")  # bytes behind the reply came before the next request
        self._become(consequence.event)
        return outcome

    def _note_arrival(self, verdict: Verdict, now_s: float) -> None:
        """Keep the number and the time of the last arrival of this kind of frame."""
        self._arrivals += 1
        if verdict is Verdict.ANSWERED:
            kind = reply_kind(self._unit_id, self._request)
            self._arrived[kind], self._arrived_s[kind] = self._arrivals, now_s
        elif verdict in (Verdict.REFUSED, Verdict.DEFERRED):
            self._arrived[exception_kind(self._unit_id, self._request)] = self._arrivals

    def _become(self, event: ConnectionEvent) -> None:
        state = TRANSITIONS[self.state, event]
        if self._framing.numbered and state in (ConnectionState.SUSPECT, ConnectionState.READY):
            state = ConnectionState.OUT_OF_STEP if self._framing.out_of_step else ConnectionState.READY
        self.state = state

    def _last_arrival(self, unit_id: int, one: Request) -> int:
        """The number of the last arrival that could be an answer to this read: its reply, or an exception."""
        kinds = reply_kind(unit_id, one), exception_kind(unit_id, one)
        return max(self._arrived.get(kind, NEVER) for kind in kinds)

    def _may_answer(self, unit_id: int, one: Request) -> bool:
        return reply_kind(unit_id, one) not in self._silent

    def _clean(self, unit_id: int, request: Request, tries: Iterable[Request], now_s: float) -> Iterator[Request]:
        """The reads whose replies differ from every outstanding frame and from the reply to `request`."""
        own = reply_kind(unit_id, request)
        kinds = ((one, reply_kind(unit_id, one)) for one in tries)
        return (one for one, kind in kinds if kind != own and not self._outstanding.holds(kind, now_s))

    def _known(self, unit_id: int) -> Iterator[Request]:
        """Reads that this unit has answered, and the first parts of them."""
        known = [request for kind, request in self._answered.items() if kind[0] == unit_id]
        yield from known
        for request in known:
            for count in range(1, requests.read_count(request)):
                yield requests.read_like(request, count)


def _other_lengths(request: Request) -> Iterator[Request]:
    """Reads from the same address on, by the same function where that reads."""
    for count in range(1, requests.MAX_READ_REGISTERS + 1):
        yield requests.read_like(request, count)


def _other_functions(request: Request) -> Iterator[Request]:
    """One read by each other function. A device without the function refuses, which proves as much as a reply."""
    address = requests.read_like(request, 1).address
    reads = (requests.read_holding, requests.read_input, requests.read_discrete, requests.read_coils)
    for read in reads:
        other = read(address, 1)
        if other.function != request.function:
            yield other
