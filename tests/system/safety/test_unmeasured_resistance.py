"""A resistance that the heat source does not measure, or measures too coarsely, checks and replaces nothing.

A TCLab computes its voltage from the duty. The constant resistance that follows must not look like that of a cold wire.
"""

from dataclasses import replace
from math import isfinite, isnan

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import TripError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import WireChecks
from smadrive.safety.faults import Fault
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
)
BALANCE = HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15)
RESISTANCE = WireResistance(22.0, 16.5, 0.008, 0.04, 0.005, 0.01, 0.0, (20.0, 80.0, 140.0), (15.2, 15.5, 15.8))
PROFILES = {"board": "tclab", "laser": "baumer-om20"}


@pytest.mark.parametrize("resistance", [None, RESISTANCE], ids=["without", "with"])
def test_bead_that_is_off_trips_with_the_resistance_of_another_rig(resistance):
    bench, clock = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3), VirtualClock()
    clock.follow(bench.advance_to)
    device = bench.attach(load_profile("tclab"))
    bench.sensors.bead.loosen_bead(contact=0.01, over_s=0.0)
    checks = WireChecks(WireModel(MODEL, BALANCE, resistance))
    hottest_c = []

    def record(_tick):
        hottest_c.append(bench.plant.temperature_c)

    rig = Rig(load_rig("tclab"), transports={"board": device.transport(clock)})
    with pytest.raises(TripError) as tripped, rig:
        rig.drive(ConstantCurrentController(0.4, 20.0), BALANCE, record, checks)
    assert tripped.value.number == Fault.READS_TOO_COLD.number
    assert max(hottest_c) < rig.config.limits.temperature_max_c


def test_unmeasured_resistance_replaces_no_displacement_sensor():
    bench, clock = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3), VirtualClock()
    clock.follow(bench.advance_to)
    devices = {name: bench.attach(load_profile(profile)) for name, profile in PROFILES.items()}
    config = load_rig("tclab").model_dump(exclude_none=True)
    config["devices"] = [
        *config["devices"],
        {"name": "laser", "profile": PROFILES["laser"], "url": "sim://flexinol-lt-0.15mm"},
    ]
    ticks = []

    def record(tick):
        ticks.append(tick)
        if tick.time_s > 5.0:
            devices["laser"].faults.refuse(4, for_s=100.0)

    transports = {name: device.transport(clock) for name, device in devices.items()}
    reference = sine(low_mm=2.0, high_mm=4.0, period_s=10.0, cycles=0.5).with_approach(0.0, 5.0)
    with Rig(RigConfig.model_validate(config), transports=transports) as rig:
        rig.track(reference, WireModel(MODEL, BALANCE, RESISTANCE), HysteresisInverse(MODEL), record)
    assert any(isfinite(tick.measurement.displacement_mm) for tick in ticks)
    assert isnan(ticks[-1].measurement.displacement_mm)
    assert not any(tick.command.uses_resistance or isfinite(tick.command.by_resistance_mm) for tick in ticks)


@pytest.mark.parametrize(("model_id", "is_used"), [(60062, True), (60181, False)], ids=["1 mA", "10 mA"])
def test_resolution_is_that_of_the_model_that_answers(model_id, is_used):
    bench, clock = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3), VirtualClock()
    clock.follow(bench.advance_to)
    config = load_rig("bench-supply")
    profiles = {device.name: device.profile for device in config.devices}
    profiles["supply"] += f":model_id={model_id}"
    transports = {name: bench.attach(load_profile(one)).transport(clock) for name, one in profiles.items()}
    steep = replace(RESISTANCE, martensite_ohm_per_k=0.0, strain=0.0, austenite_ohm=(14.5,) * 3)
    with Rig(config, transports=transports) as rig:
        assert (rig.usable(WireModel(MODEL, BALANCE, steep)).resistance is not None) is is_used
