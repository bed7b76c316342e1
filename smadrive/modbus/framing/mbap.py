"""Modbus TCP frames: a header instead of the CRC (messaging guide V1.0b, section 3.1.3).

    frame = transaction (2) | protocol, 0 (2) | length (2) | unit id (1) | PDU (1..253)

`length` counts unit id and PDU. The reply repeats the transaction number of its request.
"""

from __future__ import annotations

import struct
from typing import NamedTuple, Self

HEADER_SIZE = 7
PROTOCOL = 0
NO_FRAME = 0

_HEADER = struct.Struct(">HHHB")
_LENGTHS = range(2, 255)


class Header(NamedTuple):
    """The header before the PDU."""

    transaction: int
    protocol: int
    length: int
    unit_id: int

    @classmethod
    def of(cls, frame: bytes) -> Self:
        """Return the header of a frame of at least HEADER_SIZE bytes."""
        return cls(*_HEADER.unpack_from(frame))


def seal(transaction: int, unit_id: int, pdu: bytes) -> bytes:
    """Return the frame that carries `pdu` to or from `unit_id`."""
    return _HEADER.pack(transaction, PROTOCOL, len(pdu) + 1, unit_id) + pdu


def frame_size(head: bytes) -> int | None:
    """Return the number of bytes in the frame that begins with `head`.

    Return None while `head` is too short, and NO_FRAME for an impossible length.
    """
    if len(head) < HEADER_SIZE:
        return None
    length = Header.of(head).length
    return HEADER_SIZE - 1 + length if length in _LENGTHS else NO_FRAME
