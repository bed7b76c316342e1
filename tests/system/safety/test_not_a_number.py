"""A supply with float registers may measure NaN: no check is skipped, and no run ends with a ValueError."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.interface import Command
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import SafetyError, TripError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import RigConfig, load_rig
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import shutdown_of
from smadrive.wire.wire_model import WireModel
from tests.on_bench import rig_on

SIM = "flexinol-lt-0.15mm"
PERIOD_S = 0.25
FAULT_AT_S = 12.0
PROFILE = """
schema = 1
[profile]
id = "float-supply"
role = "supply"
protocol = "modbus-rtu"
vendor = "nobody"
evidence = "two"
[serial]
baudrate = 115200
bytesize = 8
parity = "N"
stopbits = 1
unit_id = 1
[timing]
response_timeout_ms = 100
[roles]
heater_current = "i_set"
heater_voltage = "v_set"
heater_enable = "output"
measured_current = "i_out"
measured_voltage = "v_out"
[registers.i_set]
table = "holding"
address = 0
type = "float32"
access = "rw"
min = 0.0
max = 6.0
[registers.v_set]
table = "holding"
address = 2
type = "float32"
access = "rw"
min = 0.0
max = 60.0
[registers.output]
table = "holding"
address = 4
type = "uint16"
access = "rw"
min = 0
max = 1
[registers.i_out]
table = "holding"
address = 5
type = "float32"
access = "r"
[registers.v_out]
table = "holding"
address = 7
type = "float32"
access = "r"
[[safe_state]]
register = "output"
value = 0
[[safe_state]]
register = "i_set"
value = 0
"""
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)


class Constant:
    """A controller that commands one current."""

    duration_s = 40.0

    def update(self, _time_s, _measurement, _dt_s):
        return Command(0.2)


class Scene:
    """The rig and its simulated bench. `record` returns a recorder that causes a fault at `FAULT_AT_S`."""

    def __init__(self, tmp_path):
        (tmp_path / "float-supply.toml").write_text(PROFILE, encoding="utf-8")
        base = load_rig("in-process").model_dump(exclude_none=True)
        base["devices"] = [
            {"name": "supply", "profile": str(tmp_path / "float-supply.toml"), "url": "sim://bench"},
            {"name": "reader", "profile": "autonics-tk", "url": "sim://bench"},
        ]
        base["rate_hz"] = 1.0 / PERIOD_S
        base["limits"] |= {"current_max_a": 0.4, "voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0}
        config = RigConfig.model_validate(base)
        self.bench = SimulatedBench(load_sim(SIM), seed=5)
        clock = VirtualClock()
        clock.follow(self.bench.advance_to)
        self.rig = rig_on(self.bench, config, clock)
        self.ticks = []

    def record(self, name, for_s=None):
        faults = self.bench.known_faults()
        left = [name]

        def take(tick):
            self.ticks.append(tick)
            if left and tick.time_s >= FAULT_AT_S:
                faults[left.pop()](for_s=for_s)

        return take


@pytest.fixture
def scene(tmp_path):
    return Scene(tmp_path)


@pytest.mark.parametrize("fault", ["lose_current", "lose_voltage"])
def test_a_power_that_stays_unknown_trips_and_ends_without_current(scene, fault):
    with pytest.raises(TripError) as caught, scene.rig as rig:
        rig.drive(Constant(), rig.nominal_balance, scene.record(fault))
    assert caught.value.number == Fault.POWER_UNKNOWN.number
    assert scene.ticks[-1].time_s < FAULT_AT_S + 4 * PERIOD_S
    assert "not a number" in scene.ticks[-1].measurement.supply_fault
    assert shutdown_of(caught.value).confirmed is (fault == "lose_voltage")
    assert scene.bench.plant.current_a == 0.0


@pytest.mark.parametrize("fault", ["lose_current", "lose_voltage"])
def test_a_single_sample_without_power_ends_no_tracking_run(scene, fault):
    reference = sine(low_mm=2.0, high_mm=9.0, period_s=56.0, cycles=0.25).with_approach(0.0, 10.0)
    with scene.rig as rig:
        rig.track(
            reference,
            WireModel(WIRE, rig.nominal_balance),
            HysteresisInverse(WIRE),
            scene.record(fault, for_s=1.5 * PERIOD_S),
        )
    unknown = [tick for tick in scene.ticks if tick.measurement.supply_fault is not None]
    assert 1 <= len(unknown) <= 2
    assert scene.ticks[-1].time_s > FAULT_AT_S + 10.0


def test_invalid_current_prevents_arming_and_the_confirmation_of_off(scene):
    def arm(rig):
        scene.bench.known_faults()["lose_current"]()
        rig.clock.sleep_until(rig.clock.now_s() + 1.0)
        rig.drive(Constant(), rig.nominal_balance, lambda _tick: None)

    with pytest.raises(SafetyError) as caught, scene.rig as rig:
        arm(rig)
    assert not shutdown_of(caught.value).confirmed
    assert scene.bench.plant.current_a == 0.0
