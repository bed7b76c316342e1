"""Modbus RTU frames: unit id, PDU, CRC. Only this file imports pymodbus.

    frame = unit id (1 byte) | PDU: function (1), data (0..252) | CRC-16 (2, low byte first)      4..256 bytes

A frame carries no length. pymodbus computes the length of a request from its function and byte count. The length of a
reply follows from its request, so replies need no such computation.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from fastcrc import crc16

if TYPE_CHECKING:
    from pymodbus.pdu import DecodePDU

MIN_FRAME = 4
MAX_FRAME = 256
UNKNOWN_SIZE = 0
BROADCAST = 0


@cache
def _requests() -> DecodePDU:
    """Return the decoder of pymodbus, which computes the size of a request.

    pymodbus is imported at the first call. A driver never calls this function, so it starts without this import.
    """
    from pymodbus.pdu import DecodePDU  # noqa: PLC0415

    return DecodePDU(is_server=True)


def crc(data: bytes) -> bytes:
    """Return the two CRC bytes that follow `data`."""
    return crc16.modbus(data).to_bytes(2, "little")


def seal(unit_id: int, pdu: bytes) -> bytes:
    """Return the frame that carries `pdu` to or from `unit_id`."""
    body = bytes((unit_id,)) + pdu
    return body + crc(body)


def crc_holds(frame: bytes) -> bool:
    """Return True if the last two bytes are the CRC of all bytes before them."""
    return len(frame) >= MIN_FRAME and crc(frame[:-2]) == frame[-2:]


def request_size(head: bytes) -> int | None:
    """Return the number of bytes in the request frame that begins with `head`.

    Return None while `head` is too short, and UNKNOWN_SIZE for an unknown function.
    """
    if len(head) < 2:
        return None
    if head[1] & 0x80:
        return UNKNOWN_SIZE
    try:
        kind = _requests().lookupPduClass(head)
        return UNKNOWN_SIZE if kind is None else kind.calculateRtuFrameSize(head) or None
    except IndexError:  # the sub-function is still on its way
        return None
    except NotImplementedError:  # a function whose frames pymodbus cannot measure
        return UNKNOWN_SIZE
