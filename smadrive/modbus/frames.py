"""Modbus RTU frames: unit id, PDU, CRC; the one file that touches pymodbus.

    frame = unit id (1 byte) | PDU: function (1), data (0..252) | CRC-16 (2, low byte first)      4..256 bytes

A frame carries no length: pymodbus tells, from the function and the byte count inside, how long a request is.
Who reads replies knows their length from the request, so replies need no such guess.
"""

from __future__ import annotations

from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import DecodePDU

MIN_FRAME = 4
MAX_FRAME = 256
BROADCAST = 0

_crc = FramerRTU.compute_CRC
_requests = DecodePDU(is_server=True)


def seal(unit_id: int, pdu: bytes) -> bytes:
    """The frame that carries `pdu` to or from `unit_id`."""
    body = bytes((unit_id,)) + pdu
    return body + _crc(body).to_bytes(2, "big")


def crc_holds(frame: bytes) -> bool:
    """Whether the last two bytes are the CRC of all before them."""
    return len(frame) >= MIN_FRAME and _crc(frame[:-2]) == frame[-2] << 8 | frame[-1]


def request_size(head: bytes) -> int | None:
    """Bytes of the request frame that begins with `head`: None for an unknown function, 0 while it cannot be told."""
    if len(head) < 2:
        return 0
    if head[1] & 0x80:
        return None
    try:
        kind = _requests.lookupPduClass(head)
        return None if kind is None else kind.calculateRtuFrameSize(head)
    except IndexError:  # the sub-function is still on its way
        return 0
    except NotImplementedError:  # a function whose frames pymodbus cannot measure
        return None
