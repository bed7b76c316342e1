"""Random bytes and spoiled frames at the UART of the emulated board.

    python tests/benchmarks/emulated_fuzz.py [--bytes 1000000] [--frames 100000] [--seed 0]

The board is armed and heats when a block begins, and nothing that arrives is a right request. So at the end of every
block its watchdog must have switched the heater off in time, its settings must be as before, and it must answer. A
spoiled frame must get no reply. An assertion that fails names the block.
"""

from __future__ import annotations

import argparse
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[1]))

from emulated_board import CLEAR, FAULT, IDLE, SEQUENCE, STATE, UNIT_ID, EmulatedBoard

from firmware_sim.board.emulator.microcontroller import HZ
from firmware_sim.devices.board.readings import BoardFault
from smadrive.modbus.framing import rtu

SETTINGS = ((0, 5), (48, 3), (64, 6))
WATCHDOG_S, LATE_S = 0.5, 0.02
BYTES_PER_BLOCK, FRAMES_PER_BLOCK = 8000, 200
PAUSE_S = 0.002
LONGEST_BURST = 300


def right_requests(random: Random) -> Iterator[bytes]:
    """Requests that would arm, heat, clear faults, change settings and the calibration."""
    while True:
        number = random.randrange(256, 65536)
        yield struct.pack(">BHH", 6, 40, 0x4152)
        yield struct.pack(">BHHHHB3H", 23, 16, 11, SEQUENCE, 3, 6, number, 3000, 1)
        yield struct.pack(">BHHB3H", 16, 48, 3, 6, 10_000, 1500, 9000)
        yield struct.pack(">BHH", 6, 41, 0x434C)
        yield struct.pack(">BHH", 6, SEQUENCE, number)
        yield struct.pack(">BHH", 6, 64, 17_000)
        yield struct.pack(">BHHH", 22, 48, 0, 300)


def spoiled(frame: bytes, random: Random) -> bytes:
    """Return the frame with one mistake, which makes its CRC wrong."""
    while True:
        wrong = bytearray(frame)
        at = random.randrange(len(wrong))
        match random.randrange(5):
            case 0:
                wrong[at] ^= 1 << random.randrange(8)
            case 1:
                del wrong[at:]
            case 2:
                del wrong[at]
            case 3:
                wrong.insert(at, random.randrange(256))
            case 4:
                wrong[at:] = random.randbytes(len(wrong) - at)
        if not begins_with_a_request(bytes(wrong)):
            return bytes(wrong)


def begins_with_a_request(data: bytes) -> bool:
    """Return True if the data, or their beginning, are a right frame, which the board carries out."""
    size = rtu.request_size(data)
    return rtu.crc_holds(data) or bool(size and rtu.crc_holds(data[:size]))


class Fuzz:
    """A heating board, and what its settings were at the beginning."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.board = EmulatedBoard(seed=seed)
        self.settings = self.read_settings()
        self.replies = 0

    def read_settings(self) -> list[int]:
        """Return identity, settings and calibration."""
        return [word for first, count in SETTINGS for word in self.board.read(first, count)]

    def block(self, parts: Iterator[bytes]) -> None:
        """Heat, let the parts arrive with a pause after each, and check the board."""
        board = self.board
        board.heat()
        fed = int(board.chip.probes.received_at)
        for part in parts:
            board.chip.send(part)
            board.run(len(part) * 10 / 115200 + PAUSE_S)
            self.replies += len(board.chip.receive())
        board.run(WATCHDOG_S)
        assert board.chip.sink_a == 0.0
        assert (int(board.chip.probes.disabled_at) - fed) / HZ <= WATCHDOG_S + LATE_S
        assert board.read(STATE, 2) == [FAULT, BoardFault.WATCHDOG]
        assert self.read_settings() == self.settings
        assert board.press(CLEAR) == 0
        assert board.read(STATE, 2) == [IDLE, 0]

    def bytes_of_block(self) -> Iterator[bytes]:
        """Bursts of random bytes."""
        left = BYTES_PER_BLOCK
        while left:
            count = min(left, self.random.randint(1, LONGEST_BURST))
            left -= count
            yield self.random.randbytes(count)

    def frames_of_block(self) -> Iterator[bytes]:
        """Spoiled frames."""
        requests = right_requests(self.random)
        for _ in range(FRAMES_PER_BLOCK):
            yield spoiled(rtu.seal(UNIT_ID, next(requests)), self.random)


def main() -> None:
    """Run both kinds of blocks, and print what was sent and answered."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bytes", type=int, default=1_000_000)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    fuzz = Fuzz(options.seed)
    for kind, count, size, parts in (
        ("random bytes", options.bytes, BYTES_PER_BLOCK, fuzz.bytes_of_block),
        ("spoiled frames", options.frames, FRAMES_PER_BLOCK, fuzz.frames_of_block),
    ):
        fuzz.replies = 0
        for _ in range(count // size):
            fuzz.block(parts())
        probes = fuzz.board.chip.probes
        print(f"{count} {kind}: {fuzz.replies} bytes of replies, {probes.overruns} bytes lost", flush=True)
        print(
            f"  {probes.resets_by_watchdog} resets, safety interrupt {1e6 * probes.safety_longest / HZ:.0f} us at most"
        )


if __name__ == "__main__":
    main()
