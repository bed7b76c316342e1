"""The server side of the bus, by the book.

Silent: for another unit, on a bad CRC, after a broadcast (which is carried out). Exceptions in the order of the
standard: function, quantity, address, value, device. FC23 checks both of its ranges before it writes anything.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from firmware_sim.firmware import Firmware
from firmware_sim.refusal import ILLEGAL_ADDRESS, ILLEGAL_FUNCTION, ILLEGAL_VALUE, Refusal
from firmware_sim.registers import RegisterBank
from firmware_sim.stream import RequestStream
from smadrive.modbus import frames, requests


@dataclass(slots=True)
class ResponderCounters:
    """What arrived since the start."""

    requests: int = 0
    exceptions: int = 0
    for_others: int = 0


class Responder:
    """Answers for `unit_id` out of `bank`, which shows and commands `firmware`."""

    def __init__(self, unit_id: int, bank: RegisterBank, firmware: Firmware) -> None:
        self.counters = ResponderCounters()
        self.stream = RequestStream()
        self._unit_id = unit_id
        self._bank = bank
        self._firmware = firmware
        self._functions: dict[int, Callable[[bytes], bytes]] = {
            3: lambda data: self._read("holding", data),
            4: lambda data: self._read("input", data),
            6: self._write_one,
            8: self._loop_back,
            16: self._write_several,
            22: self._mask_write,
            23: self._exchange,
        }

    def receive(self, data: bytes, time_s: float) -> list[bytes]:
        """The reply frames to the bytes that arrive at `time_s`."""
        replies = (self._answer(frame) for frame in self.stream.feed(data, time_s))
        return [reply for reply in replies if reply is not None]

    def _answer(self, frame: bytes) -> bytes | None:
        unit_id, function, data = frame[0], frame[1], frame[2:-2]
        if unit_id not in (self._unit_id, frames.BROADCAST):
            self.counters.for_others += 1
            return None
        self.counters.requests += 1
        try:
            pdu = bytes((function,)) + self._functions.get(function, _unknown)(data)
        except Refusal as refusal:
            self.counters.exceptions += 1
            pdu = bytes((function | 0x80, refusal.code))
        return None if unit_id == frames.BROADCAST else frames.seal(unit_id, pdu)

    def _read(self, table: str, data: bytes) -> bytes:
        first, count = struct.unpack(">HH", data)
        _check_quantity(count, requests.MAX_READ_REGISTERS)
        self._bank.check_readable(table, first, count)
        return self._words(table, first, count)

    def _write_one(self, data: bytes) -> bytes:
        address, word = struct.unpack(">HH", data)
        self._write(address, (word,))
        return data

    def _write_several(self, data: bytes) -> bytes:
        first, count, size = struct.unpack(">HHB", data[:5])
        _check_quantity(count, requests.MAX_WRITE_REGISTERS)
        _check_size(count, size, data[5:])
        self._write(first, requests.registers_of(data[5:]))
        return data[:4]

    def _mask_write(self, data: bytes) -> bytes:
        address, and_mask, or_mask = struct.unpack(">HHH", data)
        self._refresh("holding", address, 1)
        (word,) = self._bank.read("holding", address, 1)
        self._write(address, (word & and_mask | or_mask & ~and_mask & 0xFFFF,))
        return data

    def _exchange(self, data: bytes) -> bytes:
        read_first, read_count, write_first, write_count, size = struct.unpack(">HHHHB", data[:9])
        _check_quantity(read_count, requests.MAX_READ_REGISTERS)
        _check_quantity(write_count, requests.MAX_EXCHANGE_WRITE_REGISTERS)
        _check_size(write_count, size, data[9:])
        self._bank.check_readable("holding", read_first, read_count)
        self._write(write_first, requests.registers_of(data[9:]))
        return self._words("holding", read_first, read_count)

    @staticmethod
    def _loop_back(data: bytes) -> bytes:
        if data[:2] != b"\0\0":
            raise Refusal(ILLEGAL_FUNCTION)
        return data

    def _write(self, first: int, words: Sequence[int]) -> None:
        if first + len(words) > 0x10000:
            raise Refusal(ILLEGAL_ADDRESS)
        writes = self._bank.checked(first, words)
        values = self._bank.by_role(writes)
        self._firmware.check(values)
        self._bank.store(writes)
        self._firmware.write(values)

    def _words(self, table: str, first: int, count: int) -> bytes:
        self._refresh(table, first, count)
        return struct.pack(f">B{count}H", 2 * count, *self._bank.read(table, first, count))

    def _refresh(self, table: str, first: int, count: int) -> None:
        self._bank.publish(self._firmware.quantities(), table, first, count)


def _unknown(_data: bytes) -> bytes:
    raise Refusal(ILLEGAL_FUNCTION)


def _check_quantity(count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise Refusal(ILLEGAL_VALUE)


def _check_size(count: int, size: int, payload: bytes) -> None:
    if size != 2 * count or len(payload) != size:
        raise Refusal(ILLEGAL_VALUE)
