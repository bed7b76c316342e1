"""The function code that reads or writes each table: the first suitable code that the device knows.

The coils of some devices (Delta DTB) are read by FC02. Some devices write only by FC05 and FC06, some only by FC15 and
FC16.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from smadrive.modbus import requests
from smadrive.modbus.requests import Request

ALL_FUNCTIONS = (1, 2, 3, 4, 5, 6, 15, 16, 22, 23)

_READS = {"holding": (3,), "input": (4,), "coil": (1, 2), "discrete": (2,)}
_BUILD_READ = {
    1: requests.read_coils,
    2: requests.read_discrete,
    3: requests.read_holding,
    4: requests.read_input,
}


def read_function(table: str, codes: Collection[int]) -> int | None:
    """Return the function code that reads `table`; return None if the device has none."""
    return next((code for code in _READS[table] if code in codes), None)


def write_function(table: str, count: int, codes: Collection[int]) -> int | None:
    """Return the function code that writes `count` addresses of `table`; return None if the device has none."""
    usable = (5, 15) if table == "coil" else (6, 16)
    return next((code for code in usable[count > 1 :] if code in codes), None)


def read_request(table: str, address: int, count: int, codes: Collection[int]) -> Request:
    """Return the request that reads `count` addresses of `table`; ValueError when the device has no function for it."""
    function = read_function(table, codes)
    if function is None:
        raise ValueError(f"no function among {sorted(codes)} reads the table '{table}'")
    return _BUILD_READ[function](address, count)


def write_request(table: str, address: int, words: Sequence[int], codes: Collection[int]) -> Request:
    """Return the request that writes `words` into `table`; ValueError when the device has no function for it."""
    match write_function(table, len(words), codes):
        case 5:
            return requests.write_coil(address, bool(words[0]))
        case 6:
            return requests.write_register(address, words[0])
        case 15:
            return requests.write_coils(address, [bool(word) for word in words])
        case 16:
            return requests.write_registers(address, words)
    raise ValueError(f"no function among {sorted(codes)} writes {len(words)} addresses of the table '{table}'")


def words_of(table: str, payload: bytes, count: int) -> tuple[int, ...]:
    """Return the words in the payload of a read reply. A coil or discrete input becomes one word, 0 or 1."""
    if table in ("coil", "discrete"):
        return tuple(int(bit) for bit in requests.bits_of(payload, count))
    return requests.registers_of(payload)
