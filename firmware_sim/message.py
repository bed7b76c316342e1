"""A request or a reply, whole: to or from which unit, what it says, and in what frame it travels."""

from __future__ import annotations

from typing import NamedTuple, Self

from smadrive.modbus import frames, mbap

_READS = range(1, 5)
_EXCHANGE = 23


class Message(NamedTuple):
    """`number` is the transaction of a Modbus TCP frame; RTU frames have none."""

    unit_id: int
    pdu: bytes
    number: int | None = None

    @property
    def frame(self) -> bytes:
        """What travels."""
        if self.number is None:
            return frames.seal(self.unit_id, self.pdu)
        return mbap.seal(self.number, self.unit_id, self.pdu)

    def answered(self, pdu: bytes) -> Self:
        """The reply to this request that says `pdu`."""
        return self._replace(pdu=pdu)

    @property
    def damaged(self) -> bytes:
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
