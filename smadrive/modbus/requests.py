"""Modbus requests. Each request contains the head and the size of its right reply.

A right reply begins with bytes that are known before the request is sent: function and byte count of a read, or the
echo of a write. Its length is known, too. So a request consists of its PDU, and of the head and the size of the right
reply. Comparing the head checks function, byte count, register count and echoed address in one step. If two replies
differ in head or size, one can never be taken for the other.

Limits of the standard (application protocol V1.1b3, section 6) are checked when the request is made.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

MAX_READ_REGISTERS = 125
MAX_WRITE_REGISTERS = 123
MAX_EXCHANGE_WRITE_REGISTERS = 121
MAX_READ_BITS = 2000
MAX_WRITE_BITS = 1968


class Request(NamedTuple):
    """The PDU of a request, and the form of its right reply: the bytes `reply_head`, then `payload_size` bytes."""

    pdu: bytes
    reply_head: bytes
    payload_size: int
    writes: bool

    @property
    def function(self) -> int:
        """The function code."""
        return self.pdu[0]

    @property
    def address(self) -> int:
        """The first address that the request reads or writes. For FC23, it is the first address to read."""
        return int.from_bytes(self.pdu[1:3], "big")


def read_holding(address: int, count: int) -> Request:
    """Return a request to read `count` holding registers from `address` (FC03).

    ValueError outside the standard's limits.
    """
    return _read(3, address, count, MAX_READ_REGISTERS, 2 * count)


def read_input(address: int, count: int) -> Request:
    """Return a request to read `count` input registers from `address` (FC04).

    ValueError outside the standard's limits.
    """
    return _read(4, address, count, MAX_READ_REGISTERS, 2 * count)


def read_coils(address: int, count: int) -> Request:
    """Return a request to read `count` coils from `address` (FC01). ValueError outside the standard's limits."""
    return _read(1, address, count, MAX_READ_BITS, (count + 7) // 8)


def read_discrete(address: int, count: int) -> Request:
    """Return a request to read `count` discrete inputs from `address` (FC02).

    ValueError outside the standard's limits.
    """
    return _read(2, address, count, MAX_READ_BITS, (count + 7) // 8)


def read_count(request: Request) -> int:
    """Return the number of addresses that a read (FC01 to FC04) asks for."""
    return int.from_bytes(request.pdu[3:5], "big")


def read_like(request: Request, count: int) -> Request:
    """Return a read of `count` addresses with the address and the function of `request`.

    If `request` writes, the function is FC03. If the read would end beyond 65535, it begins at a lower address.
    """
    read = _READS.get(request.function, read_holding)
    return read(min(request.address, 0x10000 - count), count)


def write_register(address: int, word: int) -> Request:
    """Return a request to write one holding register (FC06). ValueError outside the address space or 16 bits."""
    _check_range(address, 1, 1)
    _check_words([word])
    pdu = struct.pack(">BHH", 6, address, word)
    return Request(pdu, reply_head=pdu, payload_size=0, writes=True)


def write_coil(address: int, on: bool) -> Request:
    """Return a request to write one coil (FC05). ValueError outside the address space, and unless `on` is a bool."""
    _check_range(address, 1, 1)
    _check_states([on])
    pdu = struct.pack(">BHH", 5, address, 0xFF00 if on else 0)
    return Request(pdu, reply_head=pdu, payload_size=0, writes=True)


def write_registers(address: int, words: Sequence[int]) -> Request:
    """Return a request to write consecutive holding registers (FC16). ValueError outside the standard's limits."""
    count = len(words)
    _check_range(address, count, MAX_WRITE_REGISTERS)
    _check_words(words)
    head = struct.pack(">BHH", 16, address, count)
    return Request(head + struct.pack(f">B{count}H", 2 * count, *words), head, payload_size=0, writes=True)


def write_coils(address: int, states: Sequence[bool]) -> Request:
    """Return a request to write consecutive coils (FC15). ValueError outside the standard's limits, and for no bool."""
    count = len(states)
    _check_range(address, count, MAX_WRITE_BITS)
    _check_states(states)
    head = struct.pack(">BHH", 15, address, count)
    packed = packed_bits(states)
    return Request(head + bytes((len(packed),)) + packed, head, payload_size=0, writes=True)


def exchange(write_address: int, words: Sequence[int], read_address: int, read_count: int) -> Request:
    """Return a request to write `words`, then read `read_count` holding registers, in one transaction (FC23).

    ValueError outside the standard's limits.
    """
    count = len(words)
    _check_range(write_address, count, MAX_EXCHANGE_WRITE_REGISTERS)
    _check_range(read_address, read_count, MAX_READ_REGISTERS)
    _check_words(words)
    pdu = struct.pack(f">BHHHHB{count}H", 23, read_address, read_count, write_address, count, 2 * count, *words)
    return Request(pdu, bytes((23, 2 * read_count)), payload_size=2 * read_count, writes=True)


_READS = {1: read_coils, 2: read_discrete, 3: read_holding, 4: read_input}


def packed_bits(states: Sequence[int]) -> bytes:
    """Return `states` packed into bytes, 8 in each byte. The first state is the lowest bit of the first byte."""
    return sum(1 << bit for bit, on in enumerate(states) if on).to_bytes((len(states) + 7) // 8, "little")


def registers_of(payload: bytes) -> tuple[int, ...]:
    """Return the 16-bit registers in the payload of a reply."""
    return struct.unpack(f">{len(payload) // 2}H", payload)


def bits_of(payload: bytes, count: int) -> tuple[bool, ...]:
    """Return the first `count` bits in the payload of a reply, beginning with the lowest bit of the first byte."""
    packed = int.from_bytes(payload, "little")
    return tuple(bool(packed >> bit & 1) for bit in range(count))


def _read(function: int, address: int, count: int, most: int, payload_size: int) -> Request:
    _check_range(address, count, most)
    return Request(
        pdu=struct.pack(">BHH", function, address, count),
        reply_head=bytes((function, payload_size)),
        payload_size=payload_size,
        writes=False,
    )


def _check_words(words: Sequence[int]) -> None:
    for word in words:
        if not (isinstance(word, int) and 0 <= word <= 0xFFFF):
            raise ValueError(f"{word!r} is not a word; a register holds the integers 0 to 65535")


def _check_states(states: Sequence[bool]) -> None:
    for state in states:
        if state is not True and state is not False:
            raise ValueError(f"{state!r} is not the state of a coil; a coil is True or False")


def _check_range(address: int, count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise ValueError(f"{count} addresses in one request; the standard allows 1 to {most}")
    if not 0 <= address <= 0x10000 - count:
        raise ValueError(f"{count} addresses from {address} leave the address space 0..65535")
