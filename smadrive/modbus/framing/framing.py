"""Two ways to carry a PDU: RTU frames and Modbus TCP frames.

RTU frames have neither number nor length: the client knows how long the right reply is, and must see to it that no
late reply takes its place. Modbus TCP frames have both: a reply with another number than the last request's is dropped
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
"""So many unanswered transaction numbers are kept from being used again."""
NEAR = 16
"""A far end that counts by itself may be ahead or behind by so many transactions."""


class Framing(Protocol):
    """The frames of one connection. `tail_size`: bytes that follow the PDU of a reply.

    `numbered`: replies carry the number of their request and their length; so a late one cannot be mistaken, and what
    `reply` gives is whole.
    """

    numbered: bool
    tail_size: int

    @property
    def out_of_step(self) -> bool:
        """Whether it is no longer known where the next frame begins: only a new connection helps."""
        ...

    def restart(self) -> None:
        """The connection is a new one: forget what came through the old one."""
        ...

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send; what arrives from now on may be its reply."""
        ...

    def reply(self, data: bytes) -> bytes:
        """Unit id, PDU and tail of the reply, as far as they have come with `data`."""
        ...

    def skip(self, data: bytes) -> None:
        """Take `data` that arrived before a request: it answers nothing, but a stream goes on behind it."""
        ...

    def intact(self, reply: bytes) -> bool:
        """Whether the tail proves the reply undamaged."""
        ...


class RtuFraming:
    """Unit id, PDU, CRC. Silence parts the frames, so it never gets out of step."""

    numbered = False
    tail_size = 2
    out_of_step = False

    def __init__(self) -> None:
        self._reply = b""

    def restart(self) -> None:
        """Nothing to forget: every request begins anew."""

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send."""
        self._reply = b""
        return rtu.seal(unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """All that has arrived."""
        self._reply += data
        return self._reply

    def skip(self, data: bytes) -> None:
        """Nothing to remember: the silence that must follow parts the frames."""

    def intact(self, reply: bytes) -> bool:
        """Whether the CRC holds."""
        return rtu.crc_holds(reply)


class TcpFraming:
    """Transaction number, length, unit id, PDU. TCP itself guards against damage.

    Transaction numbers are random, so that no frame that was made up or delayed before the request carries the right
    one. A number is neither near the one before it nor that of a request that is still unanswered.
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
        """Whether a frame was left unfinished: nothing in a stream marks the beginning of the next."""
        return bool(self._pending)

    def restart(self) -> None:
        """Forget the unfinished frame and the unanswered requests: nothing of them comes through a new connection."""
        self._pending = b""
        self._unanswered.clear()

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send, with a new transaction number; it counts as unanswered until its reply is there."""
        while self._is_taken(number := self._random.getrandbits(16)):
            pass
        self._transaction = number
        self._unanswered.append(number)
        return mbap.seal(number, unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """Unit id and PDU of the whole reply; empty until it is there. Replies to earlier requests are dropped.

        ProtocolError when what arrives is no Modbus TCP.
        """
        self._pending += data
        while (frame := self._frame()) is not None:
            if mbap.Header.of(frame).transaction == self._transaction:
                self._unanswered.remove(self._transaction)
                return frame[mbap.HEADER_SIZE - 1 :]
            self.dropped += 1
        return b""

    def skip(self, data: bytes) -> None:
        """Drop the whole frames; what follows them is the beginning of another. Of no Modbus TCP nothing is known."""
        self._pending += data
        with suppress(ProtocolError):
            while self._frame() is not None:
                self.dropped += 1

    def intact(self, _reply: bytes) -> bool:
        """TCP has seen to it."""
        return True

    def _frame(self) -> bytes | None:
        """The next whole frame that has arrived; ProtocolError when it is none."""
        size = mbap.frame_size(self._pending)
        if size is None:
            return None
        header = mbap.Header.of(self._pending)
        if size == mbap.NO_FRAME or header.protocol != mbap.PROTOCOL:
            raise ProtocolError(f"not a Modbus TCP frame: protocol {header.protocol}, length {header.length}")
        if len(self._pending) < size:
            return None
        frame, self._pending = self._pending[:size], self._pending[size:]
        return frame

    def _is_taken(self, number: int) -> bool:
        near = min((number - self._transaction) & 0xFFFF, (self._transaction - number) & 0xFFFF) <= NEAR
        return near or number in self._unanswered
