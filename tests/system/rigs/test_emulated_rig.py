"""The driver on the emulated board in virtual time: it falls silent, loses its cable, or the board restarts."""

from random import Random

import pytest
from emulated_board import needs_emulator

from firmware_sim.bench import simulated_device
from firmware_sim.board.emulator.microcontroller import HZ, Reset
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.errors import SmadriveError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig

pytestmark = needs_emulator
CURRENT_A, LATE_S, PERIOD_S = 0.2, 0.02, 0.05
TRIALS = 200


class EmulatedRig:
    """The shipped in-process rig with the emulated board. `rig` is the driver."""

    def __init__(self, seed):
        config = load_sim("flexinol-lt-0.15mm")
        board = config.board.model_copy(update={"implementation": "atmega328p"})
        self.random = Random(seed)
        self.device = simulated_device(config.model_copy(update={"board": board}), seed=seed)
        self.chip = self.device.firmware.chip
        self.clock = VirtualClock()
        self.clock.follow(self.device.bench.advance_to)
        self.rig = Rig(load_rig("in-process"), transports={"board": self.device.transport(self.clock)})

    def heat(self):
        """Arm, and heat for a random number of ticks and a random part of a tick."""
        self.rig.heater.arm(self.rig.config.limits.watchdog_s)
        for _ in range(self.random.randrange(2, 6)):
            self.rig.heater.exchange(CURRENT_A)
            self.wait(self.random.uniform(0.01, PERIOD_S))
        assert self.chip.sink_a > 0.0

    def wait(self, duration_s):
        """Let the time pass."""
        self.clock.sleep_until(self.clock.now_s() + duration_s)

    def check_off_in_time(self, fed):
        """Check that the board had no new sequence after the cycle `fed`, and was off in time."""
        watchdog_s = self.rig.config.limits.watchdog_s
        assert self.chip.sink_a == 0.0
        assert 0.0 < (int(self.chip.probes.disabled_at) - fed) / HZ <= watchdog_s + LATE_S

    def recover(self):
        """Let the driver see the fault, and clear it."""
        seen = self.rig.heater.exchange(CURRENT_A)
        assert (seen.armed, seen.device_faults) == (False, ("watchdog",))
        assert self.chip.sink_a == 0.0
        self.rig.enter_safe_state()
        self.rig.clear_faults()


@pytest.fixture
def emulated():
    made = EmulatedRig(seed=4)
    with made.rig:
        yield made


def fall_silent(emulated):
    emulated.heat()
    fed = int(emulated.chip.probes.received_at)
    emulated.wait(0.6)
    emulated.check_off_in_time(fed)
    emulated.recover()


def lose_the_cable(emulated):
    emulated.heat()
    fed = int(emulated.chip.probes.received_at)
    emulated.device.faults.vanish(0.8)
    with pytest.raises(SmadriveError):
        emulated.rig.heater.exchange(CURRENT_A)
    emulated.wait(0.9)
    emulated.check_off_in_time(fed)
    emulated.recover()


def restart(emulated):
    emulated.heat()
    emulated.chip.reset(emulated.random.choice(list(Reset)))
    assert emulated.chip.sink_a == 0.0
    emulated.wait(0.4)
    seen = emulated.rig.heater.exchange(CURRENT_A)
    assert (seen.armed, seen.device_faults) == (False, ())
    assert emulated.chip.sink_a == 0.0
    emulated.rig.enter_safe_state()
    emulated.wait(0.1)
    emulated.rig.measure()  # the count of conversions has begun again, and may be the one that the driver saw last


@pytest.mark.parametrize("fate", [fall_silent, lose_the_cable, restart])
def test_board_switches_off_and_the_driver_notices(emulated, fate):
    fate(emulated)
    emulated.heat()


@pytest.mark.exhaustive
@pytest.mark.parametrize("fate", [fall_silent, lose_the_cable, restart])
def test_board_switches_off_and_the_driver_notices_every_time(emulated, fate):
    for _ in range(TRIALS):
        fate(emulated)
