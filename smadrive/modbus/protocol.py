"""The client's side of Modbus without I/O: it takes a request and the bytes that arrive, and returns an outcome.

verdict.py holds the rules of the verdicts.

Two faults cannot be recognised from one frame. On RTU, a second copy of an earlier reply may arrive after a later
request of the same kind, and looks like the answer to this request. On any connection, a gateway may answer with the
reply to an older request. probes.py chooses reads whose answers exclude these two faults.
"""

from __future__ import annotations

from smadrive.errors import ProtocolError
from smadrive.modbus import requests
from smadrive.modbus.framing.framing import Framing
from smadrive.modbus.outstanding import Outstanding, exception_kind, reply_kind
from smadrive.modbus.probes import Probes
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

_FINAL = frozenset(bytes((code,)) for code in FINAL_CODES)


class ClientProtocol:
    """Judges the replies to the requests of one connection, one request at a time.

    Times are arguments; this class reads no clock and does no I/O.
    """

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._outstanding = Outstanding()
        self.probes = Probes(self._outstanding)
        self._unit_id = 0
        self._request = requests.read_holding(0, 1)
        self._head = self._exception_head = self._reply = b""
        self._size = 0
        self.state = ConnectionState.READY
        self._become(ConnectionEvent.NEW_CONNECTION)

    def new_connection(self) -> None:
        """Note a new connection. On RTU, replies to unknown requests of other programs may still arrive."""
        self._framing.restart()
        self._become(ConnectionEvent.NEW_CONNECTION)

    def stray(self, data: bytes) -> None:
        """Note that `data` arrived although no request waits for a reply. These bytes are no answer."""
        self._framing.skip(data)
        self._become(ConnectionEvent.STRAY)

    def silence(self) -> None:
        """Note that the bus has been silent for as long as a reply may take."""
        self._become(ConnectionEvent.SILENCE)

    def distrust(self, now_s: float) -> None:
        """Note that the last reply answers an older request, as its content shows. The right reply may still arrive."""
        self._outstanding.add(reply_kind(self._unit_id, self._request), now_s)
        self._become(ConnectionEvent.FAILED)

    def send(self, unit_id: int, request: Request) -> bytes:
        """Return the frame to write. Bytes that arrive from now on may be the answer to `request`."""
        self._unit_id, self._request, self._reply = unit_id, request, b""
        self._head = bytes((unit_id,)) + request.reply_head
        self._exception_head = bytes((unit_id, request.function | 0x80))
        self._size = len(self._head) + request.payload_size + self._framing.tail_size
        self._become(ConnectionEvent.SENT)
        return self._framing.request(unit_id, request.pdu)

    def send_unconfirmed(self, unit_id: int, request: Request, now_s: float) -> bytes:
        """Return the frame of a request that is sent without waiting. Its answer counts as outstanding."""
        self._outstanding.add(reply_kind(unit_id, request), now_s)
        self._outstanding.add(exception_kind(unit_id, request), now_s)
        self._become(ConnectionEvent.FAILED)
        return self._framing.request(unit_id, request.pdu)

    def receive(self, data: bytes, now_s: float) -> Outcome | None:
        """Take the received `data`. Return the outcome as soon as it is decided; None while the reply is incomplete."""
        try:
            self._reply = self._framing.reply(data)
        except ProtocolError:
            outcome: Outcome | None = Outcome(Verdict.MALFORMED, data)
        else:
            outcome = self._judged(self._reply, now_s)
        return None if outcome is None else self._concluded(outcome, now_s)

    def give_up(self, now_s: float) -> Outcome:
        """End the wait for a reply, at the deadline or after an interruption, and return the outcome."""
        return self._concluded(Outcome(Verdict.SILENT, self._reply), now_s)

    def may_be_mistaken(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Return True if an outstanding frame could be taken for the reply, so that `request` must not be sent yet."""
        return bool(self._outstanding) and self._outstanding.holds(reply_kind(unit_id, request), now_s)

    def needs_probe(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Return True if a probe must go first, because an older reply or exception could be taken for the answer.

        If only an older exception is possible, the result is True only if the unit has already answered a read that can
        serve as a probe.
        """
        if self.may_be_mistaken(unit_id, request, now_s):
            return True
        return self._exception_is_doubtful(unit_id, request, now_s) and self.probes.has_answered(
            unit_id, request, now_s
        )

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
        """Return the outcome of a reply or exception with the right head; on RTU, None until `size` bytes have arrived.

        `arrived` is the verdict if the frame is intact, and if no frame of its kind is outstanding.
        """
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
        """Return True if the frame that arrived may belong to an earlier request."""
        if arrived is Verdict.ANSWERED:
            return self.may_be_mistaken(self._unit_id, self._request, now_s)
        return self._exception_is_doubtful(self._unit_id, self._request, now_s)

    def _exception_is_doubtful(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Return True if an exception that answers an earlier request could be taken for an exception to `request`.

        The transaction numbers of Modbus TCP exclude older exceptions. They do not exclude older replies: a gateway
        may give a late reply of its serial line the number of the present request.
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
        if self._framing.numbered:
            self._framing.skip(b"")  # bytes after the reply arrived before the next request
        self._become(consequence.event)
        return outcome

    def _note_arrival(self, verdict: Verdict, now_s: float) -> None:
        """Count the finished request, and record the arrival of a right reply or an exception."""
        self.probes.note_frame()
        if verdict is Verdict.ANSWERED:
            self.probes.note_reply(self._unit_id, self._request, now_s)
        elif verdict in (Verdict.REFUSED, Verdict.DEFERRED):
            self.probes.note_exception(self._unit_id, self._request)

    def _become(self, event: ConnectionEvent) -> None:
        state = TRANSITIONS[self.state, event]
        if self._framing.numbered and state in (ConnectionState.SUSPECT, ConnectionState.READY):
            state = ConnectionState.OUT_OF_STEP if self._framing.out_of_step else ConnectionState.READY
        self.state = state
