"""The serial line of the emulated board: bytes of the host in, frames of the board out, at the speed of the line.

The simulation around the board moves in steps of 10 ms, but a reply needs only some ms. So the board runs ahead of the
simulation until the reply is complete. In the next step the simulation catches up with the board.
"""

from __future__ import annotations

from firmware_sim.board.emulator.microcontroller import HZ, Microcontroller, Sent
from smadrive.modbus.framing import rtu

FRAME_PAUSE_CYCLES = HZ * 175 // 100_000
"""A silence longer than this, 1.75 ms, separates two frames."""
PATIENCE_CYCLES = HZ // 100
"""The longest wait for the first byte of a reply, after the last byte of the host: 10 ms."""
_SLICE_CYCLES = HZ // 4000
_UNIT_ID = 1
_NO_REPLY = 11


class SerialLine:
    """The UART of `chip` and the host's end of the line."""

    def __init__(self, chip: Microcontroller, start_cycle: int = 0) -> None:
        """`start_cycle` is the cycle of `chip` at which the time of the simulation is 0."""
        self._chip = chip
        self._start_cycle = start_cycle

    def exchange(self, data: bytes) -> list[tuple[float, bytes]]:
        """Send `data`, and return the board's replies as pairs (time in s, frame).

        The time is the time of the simulation at which the last byte of the frame is complete.
        """
        self._chip.send(data)
        received: list[Sent] = []
        while not self._is_quiet(received):
            self._chip.run_until(self._chip.cycle + _SLICE_CYCLES)
            received += self._chip.receive()
        frames = _frames(received)
        return [((frame[-1].cycle - self._start_cycle) / HZ, bytes(sent.value for sent in frame)) for frame in frames]

    def answer(self, pdu: bytes) -> bytes:
        """Send the request `pdu`, and return the PDU of the reply. Return exception 11 without a valid reply."""
        for _, frame in self.exchange(rtu.seal(_UNIT_ID, pdu)):
            if rtu.crc_holds(frame):
                return frame[1:-2]
        return bytes((pdu[0] | 0x80, _NO_REPLY))

    def _is_quiet(self, received: list[Sent]) -> bool:
        chip = self._chip
        if chip.unsent:
            return False
        if received and received[-1].cycle > chip.probes.received_at:
            return chip.cycle - received[-1].cycle > FRAME_PAUSE_CYCLES
        return chip.cycle - int(chip.probes.received_at) > PATIENCE_CYCLES


def _frames(received: list[Sent]) -> list[list[Sent]]:
    """Split the received bytes into frames: a silence longer than `FRAME_PAUSE_CYCLES` begins a new frame."""
    frames: list[list[Sent]] = []
    for sent in received:
        if not frames or sent.cycle - frames[-1][-1].cycle > FRAME_PAUSE_CYCLES:
            frames.append([])
        frames[-1].append(sent)
    return frames
