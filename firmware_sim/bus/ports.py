"""The ports of devices. A port takes RTU frames, Modbus TCP frames, lines of text, or raw bytes.

RTU: a request to an absent unit gets no reply, and a request with a wrong CRC gets no reply. All devices carry out a
broadcast (a request to unit 0), and none of them replies.

Modbus TCP: a request to an absent unit gets exception 11, as from a gateway. If the connection leads to a single
device, this device also answers requests to the units 0 and 255. The port drops a frame whose protocol identifier is
not 0. After an impossible length the port drops all pending bytes, because the stream is not Modbus.

Text: a line ends with CR or LF, or when the 64 bytes of the board's buffer are full.

Raw: the port passes the bytes to the device, and the device itself finds the requests in them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol

from firmware_sim.bus.faults import Delivery
from firmware_sim.bus.message import ModbusMessage, TextMessage
from firmware_sim.bus.stream import RequestStream
from smadrive.modbus.framing import mbap, rtu
from smadrive.modbus.verdict import ExceptionCode

_ANY_UNIT = (0, 255)
_TEXT_BUFFER = 64
_TEXT_END = re.compile(rb"[\r\n]")


class Unit(Protocol):
    """A device on the bus."""

    @property
    def unit_id(self) -> int:
        """The address of the device on the bus."""
        ...

    def answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        """Carry out `request`, and return the deliveries of the reply. A broadcast has no reply."""
        ...


class Port(Protocol):
    """The devices' end of one connection: bytes in, deliveries out."""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        ...


class RtuPort:
    """A port for RTU frames, on a serial line or through a socket."""

    def __init__(self, units: Sequence[Unit]) -> None:
        self.stream = RequestStream()
        self._units = units

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        deliveries = []
        for frame in self.stream.feed(data, time_s):
            deliveries += self._answer(ModbusMessage(frame[0], frame[1:-2]), time_s)
        return deliveries

    def _answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        deliveries = []
        for unit in self._units:
            if request.unit_id in (unit.unit_id, rtu.BROADCAST):
                deliveries += unit.answer(request, time_s)
        return deliveries


class TcpPort:
    """A port for Modbus TCP frames."""

    def __init__(self, units: Sequence[Unit]) -> None:
        self._units = units
        self._pending = b""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        self._pending += data
        deliveries = []
        while (size := mbap.frame_size(self._pending)) is not None:
            if size == mbap.NO_FRAME:
                self._pending = b""
            elif len(self._pending) < size:
                break
            else:
                frame, self._pending = self._pending[:size], self._pending[size:]
                header = mbap.Header.of(frame)
                if header.protocol == mbap.PROTOCOL:
                    request = ModbusMessage(header.unit_id, frame[mbap.HEADER_SIZE :], header.transaction)
                    deliveries += self._answer(request, time_s)
        return deliveries

    def _answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        alone = len(self._units) == 1 and request.unit_id in _ANY_UNIT
        deliveries: list[Delivery] | None = None
        for unit in self._units:
            if alone or request.unit_id == unit.unit_id:
                deliveries = unit.answer(request, time_s)
        if deliveries is None:
            return [(time_s, request.reply(request.exception_pdu(ExceptionCode.NO_RESPONSE)).frame)]
        return deliveries


class TextPort:
    """A port for lines of text to one board; `answer` carries out a line, and returns the deliveries of the reply."""

    def __init__(self, answer: Callable[[TextMessage, float], list[Delivery]]) -> None:
        self._answer = answer
        self._pending = b""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        *lines, self._pending = _TEXT_END.split(self._pending + data)
        if len(self._pending) >= _TEXT_BUFFER:
            lines.append(self._pending)
            self._pending = b""
        return [delivery for line in lines if line for delivery in self._answer(TextMessage(line), time_s)]


class RawPort:
    """A port to one device that reads the bytes of the line itself; `exchange` passes the bytes to the device."""

    def __init__(self, exchange: Callable[[bytes, float], list[Delivery]]) -> None:
        self._exchange = exchange

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        return self._exchange(data, time_s)
