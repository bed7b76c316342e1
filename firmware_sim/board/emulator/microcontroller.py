"""An emulated ATmega328P with its program, and the chips of the board around it.

The caller moves the time, in cycles of 62.5 ns, and writes the inputs of the pins and chips into `world`. A fault of
the hardware is a field of `world`, or one of the methods `reset` and `hang`.
"""

from __future__ import annotations

import ctypes
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from firmware_sim.board.emulator.bindings import Probes, SentByte, World, load_library
from smadrive.errors import DeviceError

HZ = 16_000_000
RAM_FIRST, RAM_SIZE = 0x100, 2048
_GPIOR0 = 0x3E
_MOST_BYTES = 4096


class Converter(IntEnum):
    """The state of the thermocouple converter, for the field `converter` of `World`."""

    GOOD = 0
    OPEN = 1
    SHORT = 2
    ABSENT = 3
    STOPPED = 4
    RESETTING = 5


class Stuck(IntEnum):
    """The line of the I2C bus that is stuck low, for the field `stuck` of `World`."""

    NONE = 0
    SDA = 1
    SCL = 2


class Reset(IntEnum):
    """The cause of a reset."""

    LINE = 0
    BROWN_OUT = 1
    POWER = 2


class Sent(NamedTuple):
    """A byte from the board, and the cycle in which it was complete."""

    cycle: int
    value: int


class Microcontroller:
    """The emulated microcontroller. It starts at power-up, in cycle 0."""

    def __init__(self, program: Path, seed: int = 0) -> None:
        """Load the ELF file `program`. `seed` determines the content of the RAM at power-up."""
        self._library = load_library()
        self._emulator = self._library.emulator_create(str(program).encode(), seed & 0xFFFFFFFF)
        if not self._emulator:
            raise DeviceError("the emulator cannot load this program", where=program, cure="build it again with make")
        self.world: World = self._library.emulator_world(self._emulator).contents
        self.probes: Probes = self._library.emulator_probes(self._emulator).contents
        self._ram = self._library.emulator_ram(self._emulator)
        self._bytes = (SentByte * _MOST_BYTES)()

    def __del__(self) -> None:
        if emulator := getattr(self, "_emulator", None):
            self._library.emulator_destroy(emulator)

    @property
    def cycle(self) -> int:
        """The present cycle."""
        return int(self._library.emulator_cycle(self._emulator))

    @property
    def sink_a(self) -> float:
        """The set current of the sink, A; 0 while the enable line of the sink is low."""
        return float(self._library.emulator_sink_a(self._emulator))

    def run_until(self, cycle: int) -> None:
        """Run to the end of the instruction in which `cycle` is reached. DeviceError if the program crashes."""
        if cycle > self.cycle:
            self._check(self._library.emulator_run(self._emulator, cycle))

    def run(self, duration_s: float) -> None:
        """Run for `duration_s`. DeviceError if the program crashes."""
        self.run_until(self.cycle + round(duration_s * HZ))

    def step(self, instructions: int) -> None:
        """Execute a number of instructions. DeviceError if the program crashes."""
        self._check(self._library.emulator_step(self._emulator, instructions))

    def reset(self, cause: Reset = Reset.LINE) -> None:
        """Reset the microcontroller. `Reset.POWER` also resets the other chips, and gives the RAM a random content."""
        self._library.emulator_reset(self._emulator, cause)

    def hang(self) -> None:
        """Let the main loop hang.

        This has an effect only on a program that `firmware_file` has built with `hang_hook`.
        """
        self._ram[_GPIOR0] = True

    def send(self, data: bytes) -> None:
        """Let the host send `data` at 115200 bits/s, after the bytes that it is still sending."""
        self._library.emulator_send(self._emulator, data, len(data))

    @property
    def unsent(self) -> int:
        """The number of bytes that the host is still sending."""
        return int(self._library.emulator_unsent(self._emulator))

    def receive(self) -> list[Sent]:
        """Return the bytes that the board has sent since the last call."""
        count = self._library.emulator_receive(self._emulator, self._bytes, _MOST_BYTES)
        return [Sent(one.cycle, one.value) for one in self._bytes[:count]]

    def write_eeprom(self, content: bytes) -> None:
        """Replace the first bytes of the EEPROM."""
        self._library.emulator_write_eeprom(self._emulator, 0, content, len(content))

    def fill_ram(self, value: int) -> None:
        """Set every byte of the RAM to `value`."""
        ctypes.memset(ctypes.addressof(self._ram.contents) + RAM_FIRST, value, RAM_SIZE)

    def read_ram(self) -> bytes:
        """Return the content of the RAM."""
        return bytes(self._ram[RAM_FIRST : RAM_FIRST + RAM_SIZE])

    def _check(self, result: int) -> None:
        if result:
            raise DeviceError("the program of the emulated board has crashed", where=f"cycle {self.cycle}")
