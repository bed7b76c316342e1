"""Checks golden frames (recorded requests and replies) against the register map.

A profile that contradicts its golden frames is not loaded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from smadrive.devices.profile.function_codes import words_of
from smadrive.devices.profile.register import Register
from smadrive.devices.profile.schema import GoldenFrame
from smadrive.modbus import requests
from smadrive.modbus.framing import rtu

_TABLES = {1: "coil", 2: "discrete", 3: "holding", 4: "input", 5: "coil", 6: "holding", 15: "coil", 16: "holding"}


class AddressRange(NamedTuple):
    """The function code of a request, its first address, and its number of addresses."""

    function: int
    address: int
    size: int


def check_golden_frame(golden: GoldenFrame, registers: Mapping[str, Register]) -> None:
    """Raise ValueError for a wrong CRC, a response to another request, or values that differ from `golden.means`."""
    request = _frame(golden.request)
    addressed = _addressed(request)
    words: Sequence[int] = _written(addressed, request)
    if golden.response is not None:
        payload = _payload(request, addressed, _frame(golden.response))
        words = words or words_of(_TABLES[addressed.function], payload, addressed.size)
    for name, value in golden.means.items():
        if name not in registers:
            raise ValueError(f"vectors: means of '{golden.request}' names the unknown register '{name}'")
        carried = _carried(registers[name], addressed, words)
        if carried is None or abs(carried - value) > 1e-6 * abs(registers[name].scale):
            raise ValueError(f"vectors: '{golden.request}': {name} is {carried} in these frames, not {value:g}")


def _frame(text: str) -> bytes:
    try:
        frame = bytes.fromhex(text)
    except ValueError:
        raise ValueError(f"vectors: '{text}' is not a frame in hexadecimal digits") from None
    if not rtu.crc_holds(frame):
        right = rtu.crc(frame[:-2]).hex(" ").upper()
        raise ValueError(f"vectors: '{text}' ends with a wrong CRC; the right one is {right}")
    return frame


def _addressed(request: bytes) -> AddressRange:
    function, address = request[1], int.from_bytes(request[2:4], "big")
    if function not in _TABLES or rtu.request_size(request) != len(request):
        raise ValueError(f"vectors: '{request.hex(' ')}' is not a complete request of functions 1 to 6, 15 or 16")
    count = 1 if function in (5, 6) else int.from_bytes(request[4:6], "big")
    return AddressRange(function, address, count)


def _written(addressed: AddressRange, request: bytes) -> tuple[int, ...]:
    """Return the words that the request writes; return an empty tuple for a read."""
    match addressed.function:
        case 5:
            return (1 if request[4:6] == b"\xff\x00" else 0,)
        case 6:
            return requests.registers_of(request[4:6])
        case 15 | 16:
            return words_of(_TABLES[addressed.function], request[7:-2], addressed.size)
    return ()


def _payload(request: bytes, addressed: AddressRange, response: bytes) -> bytes:
    """Return the payload of the response; ValueError when the response does not answer the request."""
    if addressed.function > 4:
        head, size = request[:6], 0
    else:
        size = 2 * addressed.size if addressed.function in (3, 4) else (addressed.size + 7) // 8
        head = request[:2] + bytes((size,))
    if not response.startswith(head) or len(response) != len(head) + size + 2:
        raise ValueError(f"vectors: '{response.hex(' ')}' does not answer '{request.hex(' ')}'")
    return response[len(head) : -2]


def _carried(register: Register, addressed: AddressRange, words: Sequence[int]) -> float | None:
    at = register.address - addressed.address
    inside = register.table == _TABLES[addressed.function] and at >= 0 and at + register.size <= len(words)
    return register.codec.decode(words[at : at + register.size]).value if inside else None
