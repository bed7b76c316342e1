"""A laser that does not answer: the loop keeps its rate, goes on without it, and uses it again when it answers."""

from contextlib import nullcontext

import numpy as np
import pytest
from exact_wire import exact_wire
from on_bench import rig_on

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig, load_rig

SIM = "flexinol-lt-0.15mm"
BOARD = {"name": "board", "profile": "sma-reference", "measures": ["temperature"]}
LASER = {"name": "laser", "profile": "baumer-om20"}
SUPPLY = [{"name": "supply", "profile": "riden-rd60xx"}, {"name": "reader", "profile": "autonics-tk"}]
PERIOD_S = 0.05
FAILS_S = 5.0


def opened(devices, **settings):
    """A simulated bench, and its rig of these devices with other settings of the rig file."""
    config = load_rig("in-process").model_dump(exclude_none=True) | settings
    config["devices"] = [{"url": f"sim://{SIM}"} | device for device in devices]
    bench, clock = SimulatedBench(load_sim(SIM), seed=1), VirtualClock()
    clock.follow(bench.advance_to)
    return bench, rig_on(bench, RigConfig.model_validate(config), clock)


def tracked(fault, **parameters):
    """The ticks of a run that tracks a sine of 20 s. The laser has a fault from `FAILS_S` on."""
    bench, with_laser = opened([BOARD, LASER])
    ticks = []

    def record(tick):
        if ticks and tick.time_s >= FAILS_S > ticks[-1].time_s:
            bench.known_faults()[f"laser.{fault}"](**parameters)
        ticks.append(tick)

    with with_laser as rig:
        wire = exact_wire().wire_model(rig.nominal_balance)
        reference = sine(low_mm=2.0, high_mm=9.0, period_s=20.0, cycles=1)
        rig.track(reference, wire, HysteresisInverse(wire.model), record)
    return ticks


def missing_s(ticks):
    """The times without a displacement, in seconds."""
    return [tick.time_s for tick in ticks if np.isnan(tick.measurement.displacement_mm)]


@pytest.mark.parametrize("parameters", [{"fault": "drop"}, {"fault": "noise", "gap_s": 0.02}], ids=["silent", "noisy"])
def test_loop_keeps_its_rate_without_the_laser_and_uses_it_again(parameters):
    ticks = tracked(for_s=8.0, **parameters)
    times_s = np.array([tick.time_s for tick in ticks])
    without = (times_s > FAILS_S + 1.0) & (times_s < FAILS_S + 8.0)
    assert np.count_nonzero(without) > 0.9 * 7.0 / PERIOD_S
    assert np.diff(times_s).min() > 0.0
    assert FAILS_S < missing_s(ticks)[0] < FAILS_S + 1.0
    assert FAILS_S + 8.0 <= missing_s(ticks)[-1] + PERIOD_S < FAILS_S + 12.0


def test_two_lost_replies_of_the_laser_are_soon_over():
    assert max(missing_s(tracked("drop", replies=2))) < FAILS_S + 1.0


@pytest.mark.parametrize(("devices", "is_refused"), [(SUPPLY, False), ([*SUPPLY, LASER], True)])
def test_current_that_could_overheat_the_wire_while_the_laser_is_awaited_is_refused(devices, is_refused):
    limits = load_rig("in-process").limits.model_dump(exclude_none=True)
    limits |= {"voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0, "current_max_a": 0.46}
    refused = pytest.raises(ConfigError) if is_refused else nullcontext()
    with opened(devices, rate_hz=4.0, limits=limits)[1] as rig, refused:
        rig.drive(ConstantCurrentController(0.1, 1.0), rig.nominal_balance, lambda _tick: None)
