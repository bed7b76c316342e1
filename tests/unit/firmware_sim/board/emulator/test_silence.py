"""A host that is killed, stopped or cut off at a random moment: zero current within `watchdog_s` + 20 ms, in cycles."""

import struct
from random import Random

import pytest
from emulated_board import FAULT, SEQUENCE, STATE, UNIT_ID, EmulatedBoard, needs_emulator

from firmware_sim.board.emulator.microcontroller import HZ
from firmware_sim.devices.board.readings import BoardFault
from smadrive.modbus.framing import rtu

pytestmark = needs_emulator
WATCHDOG, LATE_S, TICK_S = 48, 0.02, 0.01
TRIALS = 200


class Silence:
    """A board that heats, and its host, which falls silent at a random moment."""

    def __init__(self, seed):
        self.random = Random(seed)
        self.board = EmulatedBoard(seed=seed)
        self.watchdog_s = self.random.choice((0.05, 0.1, 0.25, 0.5))
        assert self.board.write(WATCHDOG, round(1e3 * self.watchdog_s)) == 0
        self.board.heat()
        for _ in range(self.random.randrange(3)):
            self.tick()
        self.fed = self.tick()

    def frame(self):
        """The FC23 of the next tick."""
        self.board.sequence += 1
        words = (self.board.sequence, 3000, 1)
        return rtu.seal(UNIT_ID, struct.pack(">BHHHHB3H", 23, 16, 11, SEQUENCE, 3, 6, *words))

    def tick(self):
        """Send a tick, and return the cycle in which its last byte was complete."""
        self.board.send(self.frame())
        fed = int(self.board.chip.probes.received_at)
        self.board.run(self.random.uniform(0.001, 0.03))
        return fed

    def cut_a_frame(self):
        """Send the beginning of a tick, or the whole tick."""
        frame = self.frame()
        part = frame[: self.random.randrange(len(frame) + 1)]
        self.board.send(part)
        if part == frame:
            self.fed = int(self.board.chip.probes.received_at)

    def check_off(self):
        """Let the watchdog expire, and check that the current was zero in time."""
        self.board.run(self.watchdog_s + 2 * LATE_S)
        assert self.board.chip.sink_a == 0.0
        off_s = (int(self.board.chip.probes.disabled_at) - self.fed) / HZ
        assert self.watchdog_s - TICK_S <= off_s <= self.watchdog_s + LATE_S

    def check_fault(self):
        """Let the host go on, and check that it sees the fault and does not heat."""
        for _ in range(3):
            self.tick()
            assert self.board.chip.sink_a == 0.0
        assert self.board.read(STATE, 2) == [FAULT, BoardFault.WATCHDOG]


def killed(seed):
    silence = Silence(seed)
    silence.cut_a_frame()
    silence.check_off()


def stopped(seed):
    silence = Silence(seed)
    silence.cut_a_frame()
    silence.check_off()
    silence.check_fault()


def cable_out(seed):
    """The plug makes and breaks contact while it is pulled and plugged in: bytes are random or lost."""
    silence = Silence(seed)
    silence.board.send(silence.random.randbytes(silence.random.randrange(40)))
    silence.check_off()
    silence.board.send(silence.random.randbytes(silence.random.randrange(40)))
    silence.board.run(0.01)
    silence.check_fault()


@pytest.mark.parametrize("fate", [killed, stopped, cable_out])
def test_silence_switches_off_in_time(fate):
    fate(seed=1)


@pytest.mark.exhaustive
@pytest.mark.parametrize("fate", [killed, stopped, cable_out])
def test_silence_at_any_moment_switches_off_in_time(fate):
    for seed in range(TRIALS):
        fate(seed)
