"""An emulated board with a resistor in place of the wire, and a host that asks it on its serial line.

Times are those of the emulated microcontroller, in cycles, so a busy machine changes no result.
"""

from __future__ import annotations

import struct
from random import Random

import pytest

from firmware_sim.board.atmega328p.eeprom import image
from firmware_sim.board.emulator.build import firmware_file, missing_tools, range_for
from firmware_sim.board.emulator.microcontroller import HZ, Microcontroller
from firmware_sim.board.emulator.serial_line import SerialLine
from firmware_sim.config import load_sim
from smadrive.modbus.framing import rtu

needs_emulator = pytest.mark.skipif(
    bool(missing_tools()), reason=f"the emulated board needs {', '.join(missing_tools())}"
)

UNIT_ID = 1
WIRE_OHM = 16.5
SUPPLY_V = 18.0
STEP_S = 0.001
BOOT_S = 0.3
SEQUENCE_ECHO, STATE, FAULTS, TEMPERATURE, CURRENT, VOLTAGE, DISPLACEMENT, SAMPLES = 16, 17, 18, 20, 22, 23, 24, 26
UPTIME, ESTOP, SEQUENCE, ARM, CLEAR = 27, 29, 32, 40, 41
IDLE, ARMED, FAULT = 0, 1, 2
KEYS = {ARM: 0x4152, CLEAR: 0x434C}


class EmulatedBoard:
    """The firmware with the calibration constants of a new board. It has booted."""

    def __init__(self, *, hang_hook=False, seed=1, eeprom=None):
        board = load_sim("flexinol-lt-0.15mm").board
        fitted = range_for(board.supply_limit_a)
        self.chip = Microcontroller(firmware_file(board, hang_hook=hang_hook), seed)
        self.line = SerialLine(self.chip)
        self.world = self.chip.world
        self.world.full_scale_a, self.world.shunt_ohm = fitted.full_scale_a, fitted.shunt_ohm
        self.world.temperature_c, self.world.cold_junction_c = 40.0, 25.0
        self.chip.write_eeprom(image(123_456) if eeprom is None else eeprom)
        self.sequence = 1000
        self.run(BOOT_S)

    def run(self, duration_s):
        """Let the time pass; the current of the wire follows the sink every millisecond."""
        end = self.chip.cycle + round(duration_s * HZ)
        while self.chip.cycle < end:
            self.connect_wire()
            self.chip.run_until(min(end, self.chip.cycle + round(STEP_S * HZ)))
        self.connect_wire()

    def connect_wire(self):
        """Let the current of the sink flow through the wire."""
        world = self.world
        world.current_a = self.chip.sink_a
        world.wire_top_v = SUPPLY_V - world.current_a * world.shunt_ohm
        world.wire_bottom_v = world.wire_top_v - world.current_a * WIRE_OHM

    def send(self, frame):
        """Send the bytes of a frame, and return the frames that the board answers."""
        return [reply for _, reply in self.line.exchange(frame)]

    def ask(self, pdu):
        """Return the PDU of the reply, or None without a reply."""
        replies = self.send(rtu.seal(UNIT_ID, pdu))
        if not replies:
            return None
        (frame,) = replies
        assert rtu.crc_holds(frame)
        return frame[1:-2]

    def read(self, first, count=1):
        """Return the words of registers."""
        reply = self.ask(struct.pack(">BHH", 3, first, count))
        return list(struct.unpack(f">{count}H", reply[2:]))

    def write(self, address, word):
        """Write a register, and return the exception code, or 0."""
        reply = self.ask(struct.pack(">BHH", 6, address, word))
        return reply[1] if reply[0] & 0x80 else 0

    def press(self, address):
        """Write the key of a register, and return the exception code, or 0."""
        return self.write(address, KEYS[address])

    def command(self, current_a, enable=1):
        """Send the FC23 of a tick, and return the words 16 to 26."""
        self.sequence += 1
        written = (self.sequence, round(current_a * 1e4), enable)
        reply = self.ask(struct.pack(">BHHHHB3H", 23, 16, 11, SEQUENCE, 3, 6, *written))
        return list(struct.unpack(">11H", reply[2:]))

    def heat(self, current_a=0.3):
        """Arm the board and let the current flow."""
        assert self.press(ARM) == 0
        self.command(current_a)
        self.run(0.03)
        self.command(current_a)
        self.run(0.02)
        assert self.chip.sink_a == pytest.approx(current_a, abs=2.5e-4)

    def heat_for(self, duration_s, current_a=0.3):
        """Send the ticks of a host every 50 ms."""
        for _ in range(round(duration_s / 0.05)):
            self.command(current_a)
            self.run(0.045)

    def registers(self):
        """Return state and faults."""
        return tuple(self.read(STATE, 2))

    def wait_for_off(self, limit_s):
        """Return the time until the sink is off, in s. Fail after `limit_s`."""
        begin = self.chip.cycle
        while self.chip.sink_a > 0.0:
            assert self.chip.cycle - begin < limit_s * HZ, "the heater is still on"
            self.connect_wire()
            self.chip.run_until(self.chip.cycle + HZ // 2000)
        return (self.chip.cycle - begin) / HZ


def reset_while_heating(cause, seed):
    """Reset a heating board at a random instruction, and return it after the reset."""
    board = EmulatedBoard(seed=seed)
    board.heat()
    board.chip.step(Random(seed).randrange(60_000))
    assert board.chip.sink_a > 0.0
    board.chip.reset(cause)
    return board
