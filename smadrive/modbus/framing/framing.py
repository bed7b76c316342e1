"""Two ways to carry a PDU: RTU frames and Modbus TCP frames.

RTU frames have neither number nor length. The client knows the length of the right reply, and must keep a late reply
from taking its place. Modbus TCP frames have both. A reply with another number than that of the last request is dropped
here.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from random import Random
from typing import Protocol

from smadrive.errors import ProtocolError
from smadrive.modbus.framing import mbap, rtu

REMEMBERED = 1024
"""Number of unanswered transaction numbers that are not used again."""
NEAR = 16
"""A server that counts by itself may be ahead or behind by so many transactions."""


class Framing(Protocol):
    """The frames of one connection. `tail_size`: bytes that follow the PDU of a reply.

    `numbered`: replies carry the number of their request and their length. So a late reply cannot be mistaken, and
    `reply` returns whole frames only.
    """

    numbered: bool
    tail_size: int

    @property
    def out_of_step(self) -> bool:
        """Whether the beginning of the next frame is unknown: only a new connection helps."""
        ...

    def restart(self) -> None:
        """Forget the bytes of the old connection: a new one is open."""
        ...

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send; bytes that arrive from now on may be its reply."""
        ...

    def reply(self, data: bytes) -> bytes:
        """Unit id, PDU and tail of the reply, as far as they have arrived with `data`."""
        ...

    def skip(self, data: bytes) -> None:
        """Skip `data` that arrived before a request: it answers nothing, but a stream goes on behind it."""
        ...

    def intact(self, reply: bytes) -> bool:
        """Whether the tail proves the reply undamaged."""
        ...


class RtuFraming:
    """Unit id, PDU, CRC. Silence separates the frames, so it never gets out of step."""

    numbered = False
    tail_size = 2
    out_of_step = False

    def __init__(self) -> None:
        self._reply = b""

    def restart(self) -> None:
        """Do nothing: every request begins anew."""

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send."""
        self._reply = b""
        return rtu.seal(unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """All that has arrived."""
        self._reply += data
        return self._reply

    def skip(self, data: bytes) -> None:
        """Do nothing: the silence that follows separates the frames."""

    def intact(self, reply: bytes) -> bool:
        """Whether the CRC holds."""
        return rtu.crc_holds(reply)


class TcpFraming:
    """Transaction number, length, unit id, PDU. TCP itself guards against damage.

    Transaction numbers are random, so that no delayed or forged frame from before the request carries the right one. A
    number is neither near the previous one nor that of a request that is still unanswered.
    """

    numbered = True
    tail_size = 0

    def __init__(self, random: Random | None = None) -> None:
        self._random = random or Random()
        self._transaction = self._random.getrandbits(16)
        self._unanswered: deque[int] = deque(maxlen=REMEMBERED)
        self._pending = b""
        self.dropped = 0

    @property
    def out_of_step(self) -> bool:
        """Whether a frame was left unfinished: a stream has no mark at the beginning of the next one."""
        return bool(self._pending)

    def restart(self) -> None:
        """Forget the unfinished frame and the unanswered requests: their bytes cannot come through a new connection."""
        self._pending = b""
        self._unanswered.clear()

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send, with a new transaction number; it counts as unanswered until its reply has arrived."""
        while self._is_taken(number := self._random.getrandbits(16)):
            pass
        self._transaction = number
        self._unanswered.append(number)
        return mbap.seal(number, unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """Unit id and PDU of the whole reply; empty until it has arrived. Replies to earlier requests are dropped.

        ProtocolError when the bytes are not Modbus TCP.
        """
        self._pending += data
        while (frame := self._frame()) is not None:
            if mbap.Header.of(frame).transaction == self._transaction:
                self._unanswered.remove(self._transaction)
                return frame[mbap.HEADER_SIZE - 1 :]
            self.dropped += 1
        return b""

    def skip(self, data: bytes) -> None:
        """Drop the whole frames; the bytes behind them begin another frame. Other bytes stay pending."""
        self._pending += data
        with suppress(ProtocolError):
            while self._frame() is not None:
                self.dropped += 1

    def intact(self, _reply: bytes) -> bool:
        """True: TCP guards against damage."""
        return True

    def _frame(self) -> bytes | None:
        """The next whole frame that has arrived, None before that; ProtocolError when the bytes are not Modbus TCP."""
        size = mbap.frame_size(self._pending)
        if size is None:
            return None
        header = mbap.Header.of(self._pending)
        if size == mbap.NO_FRAME or header.protocol != mbap.PROTOCOL:
            raise ProtocolError("not a Modbus TCP frame", value=f"protocol {header.protocol}, length {header.length}")
        if len(self._pending) < size:
            return None
        frame, self._pending = self._pending[:size], self._pending[size:]
        return frame

    def _is_taken(self, number: int) -> bool:
        near = min((number - self._transaction) & 0xFFFF, (self._transaction - number) & 0xFFFF) <= NEAR
        return near or number in self._unanswered
