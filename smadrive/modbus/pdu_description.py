"""Descriptions of requests and replies in words, for the reader of a trace."""

from __future__ import annotations

import struct
from collections.abc import Callable

from smadrive.modbus import requests
from smadrive.modbus.verdict import MEANINGS

_TABLES = {1: "coils", 2: "discrete inputs", 3: "holding registers", 4: "input registers"}


def of_request(pdu: bytes) -> str:
    """Return function, addresses and values of a request as text, for example `read 11 holding registers from 16`.

    A request that is too short gives `malformed request`.
    """
    try:
        return _request(pdu)
    except (struct.error, IndexError):
        return "malformed request"


def of_reply(pdu: bytes, request: bytes) -> str:
    """Return the reply `pdu` to `request` as text: its values, its exception, or `done` for a write.

    An empty reply gives `nothing`. A reply of another function than the request gives the number of that function.
    """
    if not pdu:
        return "nothing"
    if len(pdu) == 2 and pdu[0] & 0x80:
        return f"exception {pdu[1]}, {MEANINGS.get(pdu[1], 'unknown')}"
    if pdu[0] != request[0]:
        return f"a reply to function {pdu[0]}"
    if pdu[0] in _TABLES or pdu[0] == 23:
        return _values(pdu, request)
    return "done"


def _request(pdu: bytes) -> str:
    function = pdu[0]
    first, second = struct.unpack_from(">HH", pdu, 1)
    if function in _TABLES:
        return f"read {second} {_TABLES[function]} from {first}"
    if function in _WRITES:
        return _WRITES[function](pdu, first, second)
    return f"function {function}"


def _mask(pdu: bytes, address: int, and_mask: int) -> str:
    (or_mask,) = struct.unpack_from(">H", pdu, 5)
    return f"mask register {address}: and {and_mask:#06x}, or {or_mask:#06x}"


def _exchange(pdu: bytes, read_first: int, read_count: int) -> str:
    write_first, _, size = struct.unpack_from(">HHB", pdu, 5)
    return f"write registers from {write_first}: {_words(pdu[10 : 10 + size])}, read {read_count} from {read_first}"


_WRITES: dict[int, Callable[[bytes, int, int], str]] = {
    5: lambda _pdu, address, state: f"write coil {address}: {'on' if state else 'off'}",
    6: lambda _pdu, address, word: f"write register {address}: {word}",
    15: lambda pdu, first, count: f"write coils from {first}: {_bits(pdu[6:], count)}",
    16: lambda pdu, first, _count: f"write registers from {first}: {_words(pdu[6:])}",
    22: _mask,
    23: _exchange,
}


def _values(pdu: bytes, request: bytes) -> str:
    count = int.from_bytes(request[3:5], "big")
    return _bits(pdu[2:], count) if pdu[0] <= 2 else _words(pdu[2:])


def _words(payload: bytes) -> str:
    whole = payload[: len(payload) // 2 * 2]
    return " ".join(str(word) for word in requests.registers_of(whole)) or "none"


def _bits(payload: bytes, count: int) -> str:
    return "".join("1" if bit else "0" for bit in requests.bits_of(payload, count))
