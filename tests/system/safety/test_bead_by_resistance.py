"""A bead that comes off, a strong draft, and a cold wire in a run that takes the displacement from the resistance."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import sine
from smadrive.errors import TripError
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.safety.faults import Fault

pytestmark = pytest.mark.exhaustive

BEGINS_S = 20.0
REFERENCE = sine(low_mm=3.0, high_mm=8.0, period_s=56.0, cycles=1.0).with_approach(0.0, 10.0)


class BlindRig:
    """The simulated rig without its displacement sensor. `hottest_c` is the highest temperature of the wire so far."""

    def __init__(self, seed):
        config = load_rig("in-process")
        board = config.devices[0].model_copy(update={"measures": ("temperature",)})
        self.device, clock = simulated_device(load_sim("flexinol-lt-0.15mm"), seed), VirtualClock()
        clock.follow(self.device.bench.advance_to)
        given = config.model_copy(update={"devices": (board,)})
        self.rig = Rig(given, clock, {"board": self.device.transport(clock)})
        self.most_c, self.hottest_c = config.limits.temperature_max_c, 0.0

    def track(self, wire, disturb, reference=REFERENCE, source=DisplacementFrom.RESISTANCE):
        def record(tick):
            plant = self.device.bench.plant
            self.hottest_c = max(self.hottest_c, plant.temperature_c)
            if tick.measurement.time_s > BEGINS_S and not self.disturbed:
                self.disturbed = True
                disturb(self.device.bench)

        self.disturbed = False
        inverse = HysteresisInverse(wire.model)
        with self.rig as rig:
            return rig.track(reference, wire.wire_model(), inverse, record, displacement_from=source)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("over_s", [0.5, 5.0])
def test_bead_that_comes_off_trips_before_the_wire_is_too_hot(identified, seed, over_s):
    blind = BlindRig(seed)
    with pytest.raises(TripError) as tripped:
        blind.track(identified.wire.wire, lambda bench: bench.sensors.bead.loosen_bead(contact=0.05, over_s=over_s))
    assert tripped.value.number in (Fault.READS_TOO_COLD.number, Fault.RESISTANCE_IMPLAUSIBLE.number)
    assert blind.hottest_c < blind.most_c


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_strong_draft_does_not_trip(identified, seed):
    blind = BlindRig(seed)
    loop = blind.track(identified.wire.wire, lambda bench: bench.plant.surroundings.draft(factor=2.5, for_s=20.0))
    assert loop.trips == 0
    assert blind.hottest_c < blind.most_c


@pytest.mark.parametrize("source", [DisplacementFrom.RESISTANCE, DisplacementFrom.SENSOR])
def test_wire_that_cools_to_its_cold_end_does_not_trip(identified, source):
    """While the wire cools, its current is too small to measure the resistance."""
    falling = Reference.from_samples([0.0, 10.0, 20.0, 21.0, 50.0], [0.0, 9.0, 9.0, 0.0, 0.0])
    loop = BlindRig(seed=1).track(identified.wire.wire, lambda _bench: None, falling, source)
    assert loop.trips == 0
