"""How requests reach devices: as RTU frames on a line, as Modbus TCP frames in a connection, or as lines of text.

RTU is silent for units that are not there, on a bad CRC, and after a broadcast (which all carry out). Over TCP a
connection that leads to one device reaches it as unit 0 and 255 too, and for other units there is what a gateway
answers, exception 11. Frames whose protocol is not 0 are dropped; a length that no frame can have means that the
stream is no Modbus, and all is dropped. Text ends with CR or LF, or where a board's buffer does.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol

from firmware_sim.bus.faults import Delivery
from firmware_sim.bus.message import ModbusMessage, TextMessage
from firmware_sim.bus.modbus_exception import NO_SUCH_UNIT
from firmware_sim.bus.stream import RequestStream
from smadrive.modbus.framing import mbap, rtu

_ANY_UNIT = (0, 255)
_TEXT_BUFFER = 64
_TEXT_END = re.compile(rb"[\r\n]")


class Unit(Protocol):
    """A device on the bus."""

    @property
    def unit_id(self) -> int:
        """What it answers to."""
        ...

    def answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        """Carry out `request`; what arrives as its answer, and when (nothing, if it was a broadcast)."""
        ...


class Port(Protocol):
    """One end of a conversation with the devices of a bus."""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """What is answered to the bytes that arrive at `time_s`, and when it arrives."""
        ...


class RtuPort:
    """RTU frames, on a serial line or through a socket."""

    def __init__(self, units: Sequence[Unit]) -> None:
        self.stream = RequestStream()
        self._units = units

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """What is answered to the bytes that arrive at `time_s`, and when it arrives."""
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
    """Modbus TCP frames."""

    def __init__(self, units: Sequence[Unit]) -> None:
        self._units = units
        self._pending = b""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """What is answered to the bytes that arrive at `time_s`, and when it arrives."""
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
            return [(time_s, request.answered(request.refused(NO_SUCH_UNIT)).frame)]
        return deliveries


class TextPort:
    """Lines of text, to one board; `answer` carries one out."""

    def __init__(self, answer: Callable[[TextMessage, float], list[Delivery]]) -> None:
        self._answer = answer
        self._pending = b""

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """What is answered to the bytes that arrive at `time_s`, and when it arrives."""
        *lines, self._pending = _TEXT_END.split(self._pending + data)
        if len(self._pending) >= _TEXT_BUFFER:
            lines.append(self._pending)
            self._pending = b""
        return [delivery for line in lines if line for delivery in self._answer(TextMessage(line), time_s)]
