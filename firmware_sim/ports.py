"""How requests reach a responder: RTU frames on a line, or Modbus TCP frames in a connection.

RTU is silent for another unit, on a bad CRC, and after a broadcast (which is carried out). Over TCP a connection leads
to one device: it answers as unit 0 and 255 too, and for other units what a gateway answers, exception 11. Frames whose
protocol is not 0 are dropped; a length that no frame can have means that the stream is no Modbus, and all is dropped.
"""

from __future__ import annotations

from typing import Protocol

from firmware_sim.refusal import NO_SUCH_UNIT
from firmware_sim.responder import Responder
from firmware_sim.stream import RequestStream
from smadrive.modbus import frames, mbap


class Port(Protocol):
    """One end of a conversation with a device."""

    def receive(self, data: bytes, time_s: float) -> list[bytes]:
        """The reply frames to the bytes that arrive at `time_s`."""
        ...


class RtuPort:
    """RTU frames, on a serial line or through a socket."""

    def __init__(self, responder: Responder) -> None:
        self.stream = RequestStream()
        self._responder = responder

    def receive(self, data: bytes, time_s: float) -> list[bytes]:
        """The reply frames to the bytes that arrive at `time_s`."""
        replies = (self._answer(frame) for frame in self.stream.feed(data, time_s))
        return [reply for reply in replies if reply is not None]

    def _answer(self, frame: bytes) -> bytes | None:
        unit_id = frame[0]
        if unit_id not in (self._responder.unit_id, frames.BROADCAST):
            self._responder.counters.for_others += 1
            return None
        reply = self._responder.answer(frame[1:-2])
        return None if unit_id == frames.BROADCAST else frames.seal(unit_id, reply)


class TcpPort:
    """Modbus TCP frames."""

    def __init__(self, responder: Responder) -> None:
        self._responder = responder
        self._pending = b""

    def receive(self, data: bytes, _time_s: float) -> list[bytes]:
        """The reply frames to the bytes that arrive."""
        self._pending += data
        replies = []
        while (size := mbap.frame_size(self._pending)) is not None:
            if size == mbap.NO_FRAME:
                self._pending = b""
            elif len(self._pending) < size:
                break
            else:
                frame, self._pending = self._pending[:size], self._pending[size:]
                replies += self._answer(frame)
        return replies

    def _answer(self, frame: bytes) -> list[bytes]:
        header = mbap.Header.of(frame)
        if header.protocol != mbap.PROTOCOL:
            return []
        pdu = frame[mbap.HEADER_SIZE :]
        if header.unit_id in (self._responder.unit_id, 0, 255):
            return [mbap.seal(header.transaction, header.unit_id, self._responder.answer(pdu))]
        self._responder.counters.for_others += 1
        return [mbap.seal(header.transaction, header.unit_id, bytes((pdu[0] | 0x80, NO_SUCH_UNIT)))]
