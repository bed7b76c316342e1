"""A request or a reply, whole: what it says, in what frame it travels, and how it can go wrong.

Modbus and text travel differently; what goes wrong on a bus goes wrong with both.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

from smadrive.modbus.framing import mbap, rtu

_READS = range(1, 5)
_EXCHANGE = 23


class Message(Protocol):
    """What BusFaults needs of a request and of its reply."""

    @property
    def pdu(self) -> bytes:
        """What it says."""
        ...

    @property
    def frame(self) -> bytes:
        """What travels."""
        ...

    @property
    def broadcast(self) -> bool:
        """Whether it is for all, and nobody answers."""
        ...

    def answered(self, pdu: bytes) -> Self:
        """The reply to this request that says `pdu`."""
        ...

    def refused(self, code: int) -> bytes:
        """What a reply says that refuses this request."""
        ...

    def damaged(self, chance: float) -> bytes:
        """The frame with a bit flipped; `chance`, from 0 to 1, may say which."""
        ...

    @property
    def from_another_unit(self) -> Self:
        """The same, said by another device."""
        ...

    @property
    def of_another_function(self) -> Self:
        """A reply to another request."""
        ...

    @property
    def of_less(self) -> Self:
        """A reply that says less than was asked for."""
        ...

    @property
    def of_next(self) -> Self:
        """The reply that the next request would get, if frames are numbered by counting."""
        ...


class ModbusMessage(NamedTuple):
    """`number` is the transaction of a Modbus TCP frame; RTU frames have none."""

    unit_id: int
    pdu: bytes
    number: int | None = None

    @property
    def frame(self) -> bytes:
        """What travels."""
        if self.number is None:
            return rtu.seal(self.unit_id, self.pdu)
        return mbap.seal(self.number, self.unit_id, self.pdu)

    @property
    def broadcast(self) -> bool:
        """To unit 0 of a serial line."""
        return self.unit_id == rtu.BROADCAST and self.number is None

    def answered(self, pdu: bytes) -> Self:
        """The reply to this request that says `pdu`."""
        return type(self)(self.unit_id, pdu, self.number)

    def refused(self, code: int) -> bytes:
        """The exception."""
        return bytes((self.pdu[0] | 0x80, code))

    def damaged(self, _chance: float) -> bytes:
        """The frame with a bit flipped that proves it wrong: of the CRC, or of the protocol's number."""
        flipped = bytearray(self.frame)
        flipped[-1 if self.number is None else 3] ^= 1
        return bytes(flipped)

    @property
    def from_another_unit(self) -> Self:
        """The same, said by the next unit."""
        return self._replace(unit_id=self.unit_id % 247 + 1)

    @property
    def of_another_function(self) -> Self:
        """The same words under another function code (04 for 03, 16 for 23)."""
        return self._replace(pdu=bytes((self.pdu[0] ^ 7,)) + self.pdu[1:])

    @property
    def of_less(self) -> Self:
        """A reply of one register less (bits: one byte); to a write, one without the end of its echo."""
        function = self.pdu[0]
        if function not in _READS and function != _EXCHANGE:
            return self._replace(pdu=self.pdu[:-1])
        less = 1 if function <= 2 else 2
        return self._replace(pdu=bytes((function, self.pdu[1] - less)) + self.pdu[2:-less])

    @property
    def of_next(self) -> Self:
        """The same under the next transaction number."""
        return self if self.number is None else self._replace(number=(self.number + 1) & 0xFFFF)


class TextMessage(NamedTuple):
    """A line of text; a reply ends with CR LF."""

    pdu: bytes

    @property
    def frame(self) -> bytes:
        """What travels."""
        return self.pdu + b"\r\n"

    @property
    def broadcast(self) -> bool:
        """Every line is for the one board that is there."""
        return False

    def answered(self, pdu: bytes) -> Self:
        """The reply to this request that says `pdu`."""
        return self._replace(pdu=pdu)

    def refused(self, _code: int) -> bytes:
        """The command in capitals: what the board says to one that it does not know."""
        return self.pdu.upper()

    def damaged(self, chance: float) -> bytes:
        """The frame with any bit flipped: perhaps another digit, and nothing that proves it wrong."""
        flipped = bytearray(self.frame)
        at, bit = divmod(int(chance * 8 * len(flipped)), 8)
        flipped[at] ^= 1 << bit
        return bytes(flipped)

    @property
    def from_another_unit(self) -> Self:
        """What another kind of board says."""
        return self._replace(pdu=b"ok")

    @property
    def of_another_function(self) -> Self:
        """A number, but the reply to another command."""
        return self._replace(pdu=b"0.000")

    @property
    def of_less(self) -> Self:
        """The reply without its last character."""
        return self._replace(pdu=self.pdu[:-1])

    @property
    def of_next(self) -> Self:
        """The same: lines have no numbers."""
        return self
