"""The measurement that trips is the last row of the log, and every reader of the log can use it."""

import numpy as np
import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import TripError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import load_rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.run import run_metrics, tripped_loop_metrics
from smadrive.runs.replay import replay
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.runs.run_metadata import excitation_record
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import shutdown_of
from smadrive.wire.wire_model import WireModel
from tests.on_bench import rig_on

MODEL = DuhemModel.gaussian(
    mu_heating=93.0, mu_cooling=71.0, sigma_heating=6.0, sigma_cooling=6.0, scale=11.0, input_range=(20.0, 130.0)
)
BREAKS_AT = 40


class TrippedRun:
    """A run that `run(rig, path, record)` executes until a fault of the bench trips."""

    def __init__(self, path, run, fault, **parameters):
        self.bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=5)
        clock = VirtualClock()
        clock.follow(self.bench.advance_to)
        self.ticks = []
        self.currents_a = []

        def take(tick):
            self.ticks.append(tick)
            self.currents_a.append(self.bench.plant.current_a)
            if len(self.ticks) == BREAKS_AT:
                self.bench.known_faults()[fault](**parameters)

        with pytest.raises(TripError) as caught, rig_on(self.bench, load_rig("in-process"), clock) as rig:
            run(rig, path, take)
        self.trip = caught.value
        self.log = read_log(path)


def track(rig, path, take):
    reference = sine(low_mm=1.0, high_mm=8.0, period_s=20.0, cycles=1.0).with_approach(0.0, 5.0)
    experiment = reference, WireModel(MODEL, rig.nominal_balance), HysteresisInverse(MODEL)
    with record_tracking(path, rig, *experiment) as recorder:
        rig.track(*experiment, lambda tick: (recorder.tick(tick), take(tick)))


def excite(rig, path, take):
    excitation = rig.excitation(22.0)
    with record_excitation(path, rig, excitation) as recorder:
        rig.excite(excitation, lambda tick: (recorder.tick(tick), take(tick)))


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    return TrippedRun(tmp_path_factory.mktemp("tracked") / "run.h5", track, "open_thermocouple")


@pytest.fixture(scope="module")
def excited(tmp_path_factory):
    return TrippedRun(tmp_path_factory.mktemp("excited") / "run.h5", excite, "open_thermocouple")


def test_last_tick_holds_the_measurement_that_tripped_and_no_current(tracked):
    assert tracked.trip.number == Fault.DEVICE_FAULT.number
    *before, last = tracked.ticks
    assert last.tripped
    assert not any(tick.tripped for tick in before)
    assert last.measurement.device_faults
    assert last.command == before[-1].command._replace(commanded_a=0.0, power_w=0.0)


def test_tick_of_a_trip_is_recorded_after_the_heater_is_off(tracked):
    assert tracked.currents_a[-2] > 0.0
    assert tracked.currents_a[-1] == 0.0


def test_log_marks_the_row_that_tripped_and_names_its_faults(tracked):
    np.testing.assert_array_equal(np.flatnonzero(tracked.log.columns["tripped"]), [len(tracked.ticks) - 1])
    assert tripped_loop_metrics(tracked.log).ticks == len(tracked.ticks)
    assert any(event.message.startswith("faults: ") for event in tracked.log.events)


def test_replay_of_a_tripped_run_is_its_record(tracked, excited):
    assert replay(tracked.log).exact
    assert replay(excited.log).exact


def test_identification_leaves_the_measurement_that_tripped_out(excited):
    assert np.isnan(excited.log.columns["temperature_c"][-1])
    assert excitation_record(excited.log).time_s.size == len(excited.ticks) - 1


def test_metrics_contain_the_reading_that_tripped(tmp_path):
    run = TrippedRun(tmp_path / "run.h5", excite, "drift_thermocouple", rate_c_per_s=200.0)
    (tripped_c,) = run.log.columns["temperature_c"][run.log.tripped_rows]
    assert run_metrics(run.log).temperature_max_c == tripped_c


def test_record_that_fails_does_not_hide_the_trip(tmp_path):
    full = OSError("full")

    def run(rig, path, take):
        def record(tick):
            recorder.tick(tick)
            take(tick)
            if tick.tripped:
                raise full

        excitation = rig.excitation(22.0)
        with record_excitation(path, rig, excitation) as recorder:
            rig.excite(excitation, record)

    tripped = TrippedRun(tmp_path / "run.h5", run, "open_thermocouple")
    assert tripped.trip.__cause__ is full
    assert shutdown_of(tripped.trip).confirmed
