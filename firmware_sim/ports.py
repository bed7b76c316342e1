"""How requests reach the devices of a bus: as RTU frames on a line, or as Modbus TCP frames in a connection.

RTU is silent for units that are not there, on a bad CRC, and after a broadcast (which all carry out). Over TCP a
connection that leads to one device reaches it as unit 0 and 255 too, and for other units there is what a gateway
answers, exception 11. Frames whose protocol is not 0 are dropped; a length that no frame can have means that the
stream is no Modbus, and all is dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from firmware_sim.faults import Delivery
from firmware_sim.message import Message
from firmware_sim.refusal import NO_SUCH_UNIT
from firmware_sim.stream import RequestStream
from smadrive.modbus import frames, mbap

_ANY_UNIT = (0, 255)


class Unit(Protocol):
    """A device on the bus."""

    @property
    def unit_id(self) -> int:
        """What it answers to."""
        ...

    def answer(self, request: Message, time_s: float) -> list[Delivery]:
        """Carry out `request`; what arrives as its answer, and when (nothing, if it was a broadcast)."""
        ...

    def overhear(self) -> None:
        """A request for another passes by."""
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
        requests = (Message(frame[0], frame[1:-2]) for frame in self.stream.feed(data, time_s))
        return [delivery for request in requests for delivery in self._answer(request, time_s)]

    def _answer(self, request: Message, time_s: float) -> list[Delivery]:
        deliveries = []
        for unit in self._units:
            if request.unit_id in (unit.unit_id, frames.BROADCAST):
                deliveries += unit.answer(request, time_s)
            else:
                unit.overhear()
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
                    request = Message(header.unit_id, frame[mbap.HEADER_SIZE :], header.transaction)
                    deliveries += self._answer(request, time_s)
        return deliveries

    def _answer(self, request: Message, time_s: float) -> list[Delivery]:
        alone = len(self._units) == 1 and request.unit_id in _ANY_UNIT
        deliveries: list[Delivery] | None = None
        for unit in self._units:
            if alone or request.unit_id == unit.unit_id:
                deliveries = unit.answer(request, time_s)
            else:
                unit.overhear()
        if deliveries is None:
            return [(time_s, request.answered(bytes((request.pdu[0] | 0x80, NO_SUCH_UNIT))).frame)]
        return deliveries
