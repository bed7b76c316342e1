"""A displacement sensor that gives a new reading only now and then, or no more, while the bead is off the wire."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import TripError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import WireChecks
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
)
WIRE = WireModel(MODEL, HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15))
LASER = {"name": "laser", "profile": "baumer-om20", "url": "sim://flexinol-lt-0.15mm"}


class LooseBead:
    """A board whose bead is off the wire, and a laser that is read at `laser_hz`."""

    def __init__(self, laser_hz):
        config = load_rig("in-process").model_dump(exclude_none=True, exclude={"feedback"})
        config["rate_hz"] = 10.0
        config["limits"] |= {"stale_after_s": 5.0}
        board = config["devices"][0] | {"measures": ["temperature"]}
        config["devices"] = [board, LASER | {"rate_hz": laser_hz}]
        self.bench, clock = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=1), VirtualClock()
        clock.follow(self.bench.advance_to)
        self.bench.sensors.bead.loosen_bead(contact=0.0, over_s=0.0)
        self.devices = {one["name"]: self.bench.attach(load_profile(one["profile"])) for one in config["devices"]}
        transports = {name: device.transport(clock) for name, device in self.devices.items()}
        self.rig = Rig(RigConfig.model_validate(config), transports=transports)
        self.hottest_c = 0.0

    def heat(self, silent_after_s):
        """Heat with 0.5 A until the trip. The laser is silent from `silent_after_s` on; None: it always answers."""

        def record(tick):
            self.hottest_c = max(self.hottest_c, self.bench.plant.temperature_c)
            if silent_after_s is not None and tick.time_s > silent_after_s:
                self.devices["laser"].faults.drop(for_s=100.0)

        with self.rig as rig:
            rig.drive(ConstantCurrentController(0.5, 20.0), WIRE.balance, record, WireChecks(WIRE))


@pytest.mark.parametrize(("laser_hz", "silent_after_s"), [(10.0, None), (0.2, None), (10.0, 0.1)])
def test_displacement_of_an_earlier_time_does_not_hide_an_overheated_wire(laser_hz, silent_after_s):
    loose = LooseBead(laser_hz)
    with pytest.raises(TripError):
        loose.heat(silent_after_s)
    assert loose.hottest_c < loose.rig.config.limits.temperature_max_c
