"""Two ways to carry a PDU: RTU frames and Modbus TCP frames.

An RTU frame carries neither a transaction number nor its length. The client knows the length of the right reply, and
must itself prevent that a late reply is taken for the right reply. A Modbus TCP frame carries both: this file drops
each reply whose transaction number differs from the number of the last request.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from random import Random
from typing import Protocol

from smadrive.errors import ProtocolError
from smadrive.modbus.framing import mbap, rtu

REMEMBERED = 1024
"""The transaction numbers of the latest unanswered requests, at most this many, are not used again."""
NEAR = 16
"""A new transaction number differs from the previous one by more than this: a faulty server may be off by a few."""


class Framing(Protocol):
    """The frames of one connection.

    tail_size    number of bytes after the PDU of a reply
    numbered     True if a reply carries its length and the transaction number of its request: then `reply` drops
                 frames with another number, and returns complete frames only
    """

    numbered: bool
    tail_size: int

    @property
    def out_of_step(self) -> bool:
        """True if the position of the next frame is unknown, so that only a new connection helps."""
        ...

    def restart(self) -> None:
        """Forget the bytes of the old connection, because a new one is open."""
        ...

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """Return the frame to send. Bytes that arrive from now on may be its reply."""
        ...

    def reply(self, data: bytes) -> bytes:
        """Take the received `data`; return unit id, PDU and tail of the reply, as far as they have arrived."""
        ...

    def skip(self, data: bytes) -> None:
        """Drop `data`, which arrived before the next request was sent: no part of it may count as a reply."""
        ...

    def intact(self, reply: bytes) -> bool:
        """Return True if the CRC of an RTU reply is right. A Modbus TCP reply has no CRC: the result is always True."""
        ...


class RtuFraming:
    """Frames of unit id, PDU and CRC. Silence separates the frames, so the beginning of each frame is known."""

    numbered = False
    tail_size = 2
    out_of_step = False

    def __init__(self) -> None:
        self._reply = b""

    def restart(self) -> None:
        """Do nothing, because every request begins with an empty buffer."""

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """Return the frame to send."""
        self._reply = b""
        return rtu.seal(unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """Return all bytes that have arrived since the request."""
        self._reply += data
        return self._reply

    def skip(self, data: bytes) -> None:
        """Do nothing, because `request` empties the buffer."""

    def intact(self, reply: bytes) -> bool:
        """Return True if the CRC at the end of the reply is right."""
        return rtu.crc_holds(reply)


class TcpFraming:
    """Frames of transaction number, length, unit id and PDU. TCP itself detects damage.

    Transaction numbers are random, so that a delayed or forged frame hardly ever carries the number of the request.
    A new number is not near the previous number, and no unanswered request has it.
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
        """True if the last frame is incomplete or malformed: the stream has no mark where the next frame begins."""
        return bool(self._pending)

    def restart(self) -> None:
        """Forget the incomplete frame and the unanswered requests: a new connection cannot carry the missing bytes."""
        self._pending = b""
        self._unanswered.clear()

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """Return the frame to send. Its new transaction number counts as unanswered until the reply has arrived."""
        while self._is_taken(number := self._random.getrandbits(16)):
            pass
        self._transaction = number
        self._unanswered.append(number)
        return mbap.seal(number, unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """Take the received `data`; return unit id and PDU of the reply, or no bytes while the reply is incomplete.

        Replies to earlier requests are dropped. ProtocolError when the bytes are not Modbus TCP.
        """
        self._pending += data
        while (frame := self._frame()) is not None:
            if mbap.Header.of(frame).transaction == self._transaction:
                self._unanswered.remove(self._transaction)
                return frame[mbap.HEADER_SIZE - 1 :]
            self.dropped += 1
        return b""

    def skip(self, data: bytes) -> None:
        """Drop the complete frames in `data`. Keep the bytes after them, the beginning of an incomplete frame."""
        self._pending += data
        with suppress(ProtocolError):
            while self._frame() is not None:
                self.dropped += 1

    def intact(self, _reply: bytes) -> bool:
        """Return True: a Modbus TCP reply has no check sum, because TCP itself detects damage."""
        return True

    def _frame(self) -> bytes | None:
        """Remove and return the next frame; None while it is incomplete. ProtocolError when it is not Modbus TCP."""
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
