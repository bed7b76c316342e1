"""A thermometer that falls silent: until the trip, the heater must not overheat the wire that nobody sees."""

from contextlib import suppress

import pytest
from on_bench import rig_on

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.errors import ConfigError, TripError
from smadrive.rig.config import RigConfig, load_rig


def supply_config(**limits):
    base = load_rig("in-process").model_dump(exclude_none=True)
    base["devices"] = [
        {"name": "supply", "profile": "riden-rd60xx", "url": "sim://bench"},
        {"name": "reader", "profile": "autonics-tk", "url": "sim://bench"},
    ]
    base["rate_hz"] = 4.0
    base["limits"] |= {"voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0} | limits
    return RigConfig.model_validate(base)


def heated(config, current_a, at_c, fault="drop", **parameters):
    """Heat with a constant current; the thermometer has a fault when the wire is at `at_c`.

    Return the hottest temperature of the wire, the ticks, and the error that ended the run.
    """
    bench, ticks = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=5), []
    hottest_c, silenced = [0.0], []
    clock = VirtualClock()

    def advance(time_s):
        bench.advance_to(time_s)
        hottest_c.append(max(hottest_c.pop(), bench.plant.temperature_c))

    def record(tick):
        ticks.append(tick)
        if not silenced and bench.plant.temperature_c >= at_c:
            silenced.append(len(ticks))
            bench.known_faults()[f"reader.{fault}"](**parameters)

    clock.follow(advance)
    ended = None
    with suppress(TripError), rig_on(bench, config, clock) as rig:
        try:
            rig.drive(ConstantCurrentController(current_a, 20.0), rig.nominal_balance, record)
        except TripError as trip:
            ended = trip
    assert silenced
    return hottest_c[0], ticks[silenced[0] :], ended


@pytest.mark.parametrize(
    "parameters", [{"fault": "drop"}, {"fault": "noise", "gap_s": 0.02}, {"fault": "noise", "gap_s": 0.1}], ids=str
)
def test_wire_stays_near_its_limit_until_the_trip(parameters):
    hottest_c, ticks, ended = heated(supply_config(current_max_a=0.45), 0.45, 118.0, for_s=20.0, **parameters)
    assert isinstance(ended, TripError)
    assert hottest_c < 160.0
    assert ticks[-1].measurement.host_limits == ("temperature",)


def test_a_current_that_holds_the_wire_below_its_limit_goes_on_after_a_lost_reply():
    _, ticks, ended = heated(supply_config(current_max_a=0.4), 0.29, 90.0, replies=1)
    assert ended is None
    assert all(tick.measurement.in_force_a == pytest.approx(0.29, abs=0.001) for tick in ticks)


def test_a_run_survives_two_lost_replies():
    _, _, ended = heated(supply_config(current_max_a=0.4), 0.29, 90.0, replies=2)
    assert ended is None


def test_current_that_could_overheat_the_wire_unseen_is_refused():
    with pytest.raises(ConfigError) as refused:
        heated(supply_config(current_max_a=0.57), 0.57, 118.0, replies=1)
    assert refused.value.limit == "60 K"
