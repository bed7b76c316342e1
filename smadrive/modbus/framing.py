"""Two ways to carry a PDU, as one master needs them.

RTU frames have neither number nor length: a master knows how long the right reply is, and must see to it that no late
reply comes in its place. Modbus TCP frames have both: a reply with another number than the last request's is dropped
here, and never gets to the master.
"""

from __future__ import annotations

from typing import Protocol

from smadrive.errors import ProtocolError
from smadrive.modbus import frames, mbap


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
        return frames.seal(unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """All that has arrived."""
        self._reply += data
        return self._reply

    def intact(self, reply: bytes) -> bool:
        """Whether the CRC holds."""
        return frames.crc_holds(reply)


class TcpFraming:
    """Transaction number, length, unit id, PDU. TCP itself guards against damage."""

    numbered = True
    tail_size = 0

    def __init__(self) -> None:
        self._transaction = 0
        self._pending = b""
        self.dropped = 0

    @property
    def out_of_step(self) -> bool:
        """Whether a frame was left unfinished: nothing in a stream marks the beginning of the next."""
        return bool(self._pending)

    def restart(self) -> None:
        """Forget the unfinished frame."""
        self._pending = b""

    def request(self, unit_id: int, pdu: bytes) -> bytes:
        """The frame to send, with the next transaction number."""
        self._transaction = (self._transaction + 1) & 0xFFFF
        return mbap.seal(self._transaction, unit_id, pdu)

    def reply(self, data: bytes) -> bytes:
        """Unit id and PDU of the whole reply; empty until it is there. Replies to earlier requests are dropped.

        ProtocolError when what arrives is no Modbus TCP.
        """
        self._pending += data
        while (size := mbap.frame_size(self._pending)) is not None:
            header = mbap.Header.of(self._pending)
            if size == mbap.NO_FRAME or header.protocol != mbap.PROTOCOL:
                raise ProtocolError(
                    f"what arrived is no Modbus TCP frame (protocol {header.protocol}, length {header.length}): does "
                    "the port speak RTU? Then write rtu+tcp://"
                )
            if len(self._pending) < size:
                break
            frame, self._pending = self._pending[:size], self._pending[size:]
            if header.transaction == self._transaction:
                return frame[mbap.HEADER_SIZE - 1 :]
            self.dropped += 1
        return b""

    def intact(self, _reply: bytes) -> bool:
        """TCP has seen to it."""
        return True
