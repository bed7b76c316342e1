"""The server side of Modbus according to the standard: the PDU of a request in, the PDU of the reply out.

The responder checks a request in the order of the standard: function, quantity, address, value, device. For FC23 it
checks the range to read and the range to write before it writes. The device supports those of the functions 1 to 6, 15,
16, 22 and 23 that the profile lists. FC4 also needs an input table in the profile, and the functions for bits (1, 2, 5
and 15) need a table of coils or of discrete inputs. FC8 (loop back) is always supported.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from firmware_sim.bus.modbus_exception import ModbusException
from firmware_sim.devices.firmware import RegisterFirmware
from firmware_sim.devices.registers import RegisterBank
from smadrive.devices.profile.function_codes import words_of
from smadrive.devices.profile.schema import DeviceTiming
from smadrive.modbus import requests
from smadrive.modbus.verdict import ExceptionCode

_LOOP_BACK = 8
_COIL_STATES = {0xFF00: 1, 0x0000: 0}


@dataclass(slots=True)
class ResponderCounters:
    """The number of requests, and the number of exception replies, since the start."""

    requests: int = 0
    exceptions: int = 0


class Responder:
    """Answers Modbus requests. A read request shows values of `firmware`. A write request commands `firmware`."""

    def __init__(self, bank: RegisterBank, firmware: RegisterFirmware, timing: DeviceTiming) -> None:
        self.counters = ResponderCounters()
        self._bank = bank
        self._firmware = firmware
        self._max_read, self._max_written = timing.max_read_registers, timing.max_write_registers
        functions: dict[int, Callable[[bytes], bytes]] = {
            3: lambda data: self._read("holding", data),
            6: self._write_one,
            16: self._write_several,
            22: self._mask_write,
            23: self._exchange,
        }
        if "input" in bank.tables:
            functions[4] = lambda data: self._read("input", data)
        if bank.tables & {"coil", "discrete"}:
            bits_by_fc2 = "discrete" if "discrete" in bank.tables else "coil"
            functions |= {
                1: lambda data: self._read_bits("coil", data),
                2: lambda data: self._read_bits(bits_by_fc2, data),
                5: self._write_coil,
                15: self._write_coils,
            }
        self._functions = {code: answer for code, answer in functions.items() if code in timing.function_codes}
        self._functions[_LOOP_BACK] = self._loop_back

    def answer(self, pdu: bytes) -> bytes:
        """Return the PDU of the reply to the request `pdu`. The reply is the result of the request, or an exception."""
        function, data = pdu[0], pdu[1:]
        self.counters.requests += 1
        try:
            return bytes((function,)) + self._functions.get(function, _unknown)(data)
        except struct.error:  # the request is shorter or longer than its function requires
            code: int = ExceptionCode.ILLEGAL_VALUE
        except ModbusException as exception:
            code = exception.code
        self.counters.exceptions += 1
        return bytes((function | 0x80, code))

    def _read(self, table: str, data: bytes) -> bytes:
        first, count = struct.unpack(">HH", data)
        _check_quantity(count, self._max_read)
        self._bank.check_readable(table, first, count)
        return self._words(table, first, count)

    def _read_bits(self, table: str, data: bytes) -> bytes:
        first, count = struct.unpack(">HH", data)
        _check_quantity(count, requests.MAX_READ_BITS)
        self._bank.check_readable(table, first, count)
        self._refresh(table, first, count)
        packed = requests.packed_bits(self._bank.read(table, first, count))
        return bytes((len(packed),)) + packed

    def _write_one(self, data: bytes) -> bytes:
        address, word = struct.unpack(">HH", data)
        self._write("holding", address, (word,))
        return data

    def _write_coil(self, data: bytes) -> bytes:
        address, state = struct.unpack(">HH", data)
        if state not in _COIL_STATES:
            raise ModbusException(ExceptionCode.ILLEGAL_VALUE)
        self._write("coil", address, (_COIL_STATES[state],))
        return data

    def _write_several(self, data: bytes) -> bytes:
        first, count, size = struct.unpack(">HHB", data[:5])
        _check_quantity(count, self._max_written)
        _check_size(2 * count, size, data[5:])
        self._write("holding", first, requests.registers_of(data[5:]))
        return data[:4]

    def _write_coils(self, data: bytes) -> bytes:
        first, count, size = struct.unpack(">HHB", data[:5])
        _check_quantity(count, requests.MAX_WRITE_BITS)
        _check_size((count + 7) // 8, size, data[5:])
        self._write("coil", first, words_of("coil", data[5:], count))
        return data[:4]

    def _mask_write(self, data: bytes) -> bytes:
        address, and_mask, or_mask = struct.unpack(">HHH", data)
        self._bank.check_readable("holding", address, 1)
        self._refresh("holding", address, 1)
        (word,) = self._bank.read("holding", address, 1)
        self._write("holding", address, (word & and_mask | or_mask & ~and_mask & 0xFFFF,))
        return data

    def _exchange(self, data: bytes) -> bytes:
        read_first, read_count, write_first, write_count, size = struct.unpack(">HHHHB", data[:9])
        _check_quantity(read_count, self._max_read)
        _check_quantity(write_count, requests.MAX_EXCHANGE_WRITE_REGISTERS)
        _check_size(2 * write_count, size, data[9:])
        self._bank.check_readable("holding", read_first, read_count)
        self._write("holding", write_first, requests.registers_of(data[9:]))
        return self._words("holding", read_first, read_count)

    @staticmethod
    def _loop_back(data: bytes) -> bytes:
        if data[:2] != b"\0\0":
            raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION)
        return data

    def _write(self, table: str, first: int, words: Sequence[int]) -> None:
        if first + len(words) > 0x10000:
            raise ModbusException(ExceptionCode.ILLEGAL_ADDRESS)
        writes = self._bank.checked(table, first, words)
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
    raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION)


def _check_quantity(count: int, limit: int) -> None:
    if not 1 <= count <= limit:
        raise ModbusException(ExceptionCode.ILLEGAL_VALUE)


def _check_size(expected: int, size: int, payload: bytes) -> None:
    if size != expected or len(payload) != size:
        raise ModbusException(ExceptionCode.ILLEGAL_VALUE)
