"""A complete request or reply: its PDU, its frame, and its corrupted variants for the faults of the bus.

Modbus messages and lines of text have different frames, but the same faults.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

from smadrive.modbus.framing import mbap, rtu

_READS = range(1, 5)
_EXCHANGE = 23


class Message(Protocol):
    """A request or a reply: the interface that BusFaults uses."""

    @property
    def pdu(self) -> bytes:
        """The content: function and data, or the text of a line."""
        ...

    @property
    def frame(self) -> bytes:
        """The bytes on the line."""
        ...

    @property
    def broadcast(self) -> bool:
        """True for a request to all devices, which gets no reply."""
        ...

    def reply(self, pdu: bytes) -> Self:
        """Return the reply to this request. The reply has the content `pdu`."""
        ...

    def exception_pdu(self, code: int) -> bytes:
        """The content of an exception reply to this request."""
        ...

    def corrupted(self, random: float) -> bytes:
        """Return the frame with one flipped bit. `random`, from 0 to 1, selects the bit if there is a choice."""
        ...

    @property
    def wrong_unit(self) -> Self:
        """The same reply from another device."""
        ...

    @property
    def wrong_function(self) -> Self:
        """A reply to a request with another function."""
        ...

    @property
    def short_count(self) -> Self:
        """A reply with less data than requested."""
        ...

    @property
    def next_transaction(self) -> Self:
        """The same reply with the next transaction number. Frames without numbers stay unchanged."""
        ...


class ModbusMessage(NamedTuple):
    """A Modbus message. `number` is the transaction number of a Modbus TCP frame, and None for an RTU frame."""

    unit_id: int
    pdu: bytes
    number: int | None = None

    @property
    def frame(self) -> bytes:
        """The bytes on the line."""
        if self.number is None:
            return rtu.seal(self.unit_id, self.pdu)
        return mbap.seal(self.number, self.unit_id, self.pdu)

    @property
    def broadcast(self) -> bool:
        """True for a request to unit 0 of a serial line."""
        return self.unit_id == rtu.BROADCAST and self.number is None

    def reply(self, pdu: bytes) -> Self:
        """Return the reply to this request. The reply has the content `pdu`."""
        return type(self)(self.unit_id, pdu, self.number)

    def exception_pdu(self, code: int) -> bytes:
        """The function code with its high bit set, and the exception code."""
        return bytes((self.pdu[0] | 0x80, code))

    def corrupted(self, _random: float) -> bytes:
        """Return the frame with one flipped bit in the CRC or in the protocol identifier. A client can detect it."""
        flipped = bytearray(self.frame)
        flipped[-1 if self.number is None else 3] ^= 1
        return bytes(flipped)

    @property
    def wrong_unit(self) -> Self:
        """The same reply, but with the next unit id: 2 instead of 1."""
        return self._replace(unit_id=self.unit_id % 247 + 1)

    @property
    def wrong_function(self) -> Self:
        """The same reply, but with another function code, such as 04 instead of 03, or 16 instead of 23."""
        return self._replace(pdu=bytes((self.pdu[0] ^ 7,)) + self.pdu[1:])

    @property
    def short_count(self) -> Self:
        """The reply without its last register, or without its last byte of bits. A reply to a write loses a byte."""
        function = self.pdu[0]
        if function not in _READS and function != _EXCHANGE:
            return self._replace(pdu=self.pdu[:-1])
        less = 1 if function <= 2 else 2
        return self._replace(pdu=bytes((function, self.pdu[1] - less)) + self.pdu[2:-less])

    @property
    def next_transaction(self) -> Self:
        """The same reply with the next transaction number. An RTU reply stays unchanged."""
        return self if self.number is None else self._replace(number=(self.number + 1) & 0xFFFF)


class TextMessage(NamedTuple):
    """A line of text; a reply ends with CR LF."""

    pdu: bytes

    @property
    def frame(self) -> bytes:
        """The bytes on the line."""
        return self.pdu + b"\r\n"

    @property
    def broadcast(self) -> bool:
        """Always False, because a line of text has one receiver."""
        return False

    def reply(self, pdu: bytes) -> Self:
        """Return the reply to this request. The reply has the content `pdu`."""
        return self._replace(pdu=pdu)

    def exception_pdu(self, _code: int) -> bytes:
        """Return the text in capitals. This is the board's reply to a command that it does not know."""
        return self.pdu.upper()

    def corrupted(self, random: float) -> bytes:
        """Return the frame with any bit flipped. A digit may become another digit, which a client cannot detect."""
        flipped = bytearray(self.frame)
        at, bit = divmod(int(random * 8 * len(flipped)), 8)
        flipped[at] ^= 1 << bit
        return bytes(flipped)

    @property
    def wrong_unit(self) -> Self:
        """The text `ok`, which is the reply of another kind of board."""
        return self._replace(pdu=b"ok")

    @property
    def wrong_function(self) -> Self:
        """The text `0.000`, which is the reply to another command."""
        return self._replace(pdu=b"0.000")

    @property
    def short_count(self) -> Self:
        """The reply without its last character."""
        return self._replace(pdu=self.pdu[:-1])

    @property
    def next_transaction(self) -> Self:
        """The same reply: lines of text have no numbers."""
        return self
