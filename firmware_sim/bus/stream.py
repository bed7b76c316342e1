"""Request frames in a stream of bytes.

RTU marks the end of a frame by silence, which an operating system does not preserve. So the length of a frame is
derived from its function, and the CRC confirms the frame. After a wrong CRC the search continues one byte later. The
bytes of an incomplete frame are kept until the rest of the frame arrives; after a pause of 50 ms they are dropped.
"""

from __future__ import annotations

from smadrive.modbus.framing import rtu

FRAME_PAUSE_S = 0.05  # far more than 1.5 characters: an operating system delivers bytes in lumps


class RequestStream:
    """Cuts the bytes that `feed` gets into frames with a correct CRC."""

    def __init__(self) -> None:
        self.bad_bytes = 0
        self._pending = b""
        self._fed_s = 0.0

    def feed(self, data: bytes, time_s: float) -> list[bytes]:
        """Return the frames that are complete after `data` arrived at `time_s`."""
        if time_s - self._fed_s > FRAME_PAUSE_S:
            self._drop(len(self._pending))
        self._fed_s = time_s
        self._pending += data
        found = []
        while self._pending and (frame := self._next()):
            found.append(frame)
        self._drop(max(len(self._pending) - rtu.MAX_FRAME, 0))
        return found

    def _next(self) -> bytes | None:
        """Remove the first complete frame and the junk before it, and return the frame. Return None without a frame."""
        waiting_from = None
        for start in range(len(self._pending) - 1):
            rest = self._pending[start:]
            size = rtu.request_size(rest)
            if size == rtu.UNKNOWN_SIZE:  # the frame can only end where the data end
                size = len(rest)
            if size is None or len(rest) < size <= rtu.MAX_FRAME:
                waiting_from = start if waiting_from is None else waiting_from
            elif size <= rtu.MAX_FRAME and rtu.crc_holds(rest[:size]):
                self._drop(start)
                self._pending = self._pending[size:]
                return rest[:size]
        if waiting_from is None:
            self._drop(max(len(self._pending) - 1, 0))
        return None

    def _drop(self, count: int) -> None:
        self.bad_bytes += count
        self._pending = self._pending[count:]
