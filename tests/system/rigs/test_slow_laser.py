"""A laser is read more slowly than the loop runs: identification and control do not take its readings as new."""

import json

import numpy as np
import pytest
from exact_wire import exact_wire
from marks import exhaustive
from on_bench import rig_on

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import TripError
from smadrive.identification.reshape import shape_of
from smadrive.identification.wire import FitSettings
from smadrive.rig.config import RigConfig, load_rig
from smadrive.runs.health.entries import loop_shape, run_entry
from smadrive.runs.log.reader import read_log
from smadrive.runs.record_fit import fit_log
from smadrive.runs.run_log import record_excitation
from smadrive.wire.wire_model import travel_mm

SIM = "flexinol-lt-0.15mm"
LASER = {"name": "laser", "profile": "baumer-om20", "url": f"sim://{SIM}"}
CAVEAT = "the laser is slow"
DISTURBED_S = 18.0
"""Time at which a disturbance begins, s: 8 s after the approach."""


def bench_and_rig(rate_hz):
    """A simulated bench, and its rig with a loop at 20 Hz and a laser that is read at `rate_hz`."""
    config = load_rig("in-process").model_dump(exclude_none=True)
    config["devices"] = [config["devices"][0] | {"measures": ["temperature"]}, LASER | {"rate_hz": rate_hz}]
    bench, clock = SimulatedBench(load_sim(SIM), seed=1), VirtualClock()
    clock.follow(bench.advance_to)
    return bench, rig_on(bench, RigConfig.model_validate(config), clock)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The log of an excitation at 20 Hz, whose displacement is read at 5 Hz."""
    path = tmp_path_factory.mktemp("slow") / "excitation.h5"
    with bench_and_rig(5.0)[1] as rig:
        excitation = rig.excitation(22.0)
        with record_excitation(path, rig, excitation, caveats=json.dumps([CAVEAT])) as recorder:
            rig.excite(excitation, recorder.tick)
    return read_log(path)


@pytest.fixture(scope="module")
def fit(log):
    return fit_log(log, FitSettings("duhem", components=1))


@pytest.mark.exhaustive
def test_branches_are_where_the_wire_has_them(fit):
    true, found = load_sim(SIM).transformation, shape_of(fit.fit.model)
    assert found.mu_heating == pytest.approx(true.mu_heating_c, abs=0.2)
    assert found.mu_cooling == pytest.approx(true.mu_cooling_c, abs=0.2)


@pytest.mark.exhaustive
def test_caveats_of_the_log_are_those_of_the_wire(fit):
    assert fit.caveats == (CAVEAT,)
    assert fit.wire("excitation.h5").caveats == fit.caveats


@pytest.mark.exhaustive
def test_wire_has_not_drifted_in_its_own_excitation(log, fit, tmp_path):
    fit.wire("excitation.h5").save(tmp_path / "wire.json")
    entry = run_entry(log, tmp_path / "wire.json")
    identified = loop_shape(fit.fit.model)
    assert entry.heating_c.value == pytest.approx(identified.heating_c, abs=0.2)
    assert entry.cooling_c.value == pytest.approx(identified.cooling_c, abs=0.2)


def track(rate_hz, disturb, record, at_s=DISTURBED_S, cycles=1):
    """Track a sine. `disturb` is called with the bench at `at_s`, and `record` with the plant in each tick."""
    bench, opened = bench_and_rig(rate_hz)
    with opened as rig:
        wire = exact_wire().wire_model(rig.nominal_balance)
        periodic = sine(low_mm=2.0, high_mm=9.0, period_s=20.0, cycles=cycles)
        reference = periodic.with_approach(travel_mm(wire.model)[0], 10.0)

        def on_tick(tick):
            if round(tick.time_s, 6) == at_s:
                disturb(bench)
            record(bench.plant, tick.time_s, reference.value_mm(tick.time_s))

        rig.track(reference, wire, HysteresisInverse(wire.model), on_tick)


def rms_error(rate_hz, disturb=lambda _bench: None, cycles=1):
    """Return the RMS error from 15 s on, as a share of the travel."""
    errors_mm = []

    def record(plant, time_s, setpoint_mm):
        if time_s > 15.0:
            errors_mm.append(plant.displacement_mm - setpoint_mm)

    track(rate_hz, disturb, record, cycles=cycles)
    cold_mm, hot_mm = travel_mm(exact_wire().model)
    return np.sqrt(np.mean(np.square(errors_mm))) / abs(hot_mm - cold_mm)


@pytest.mark.parametrize(
    ("rate_hz", "most"), [(5.0, 0.001), (2.0, 0.0015), exhaustive(1.0, 0.002), exhaustive(0.5, 0.0025)]
)
def test_wire_tracks_its_reference(rate_hz, most):
    assert rms_error(rate_hz) < most


@pytest.mark.exhaustive
@pytest.mark.parametrize(("rate_hz", "most"), [(5.0, 0.008), (2.0, 0.015), (1.0, 0.02)])
def test_wire_tracks_its_reference_in_a_draft(rate_hz, most):
    assert rms_error(rate_hz, lambda bench: bench.plant.surroundings.draft(1.6, for_s=20.0)) < most


@pytest.mark.exhaustive
@pytest.mark.parametrize(("rate_hz", "most"), [(5.0, 0.02), (2.0, 0.04)])
def test_wire_tracks_its_reference_after_a_load(rate_hz, most):
    assert rms_error(rate_hz, lambda bench: bench.plant.load.step_load(60.0, over_s=1.0)) < most


@pytest.mark.exhaustive
def test_controller_does_not_take_a_loose_bead_for_a_load():
    """The laser is read in every tick. A shift that followed the wrong temperature would oscillate."""
    assert rms_error(20.0, lambda bench: bench.sensors.bead.loosen_bead(0.2, over_s=1.0), cycles=2) < 0.01


@pytest.mark.exhaustive
@pytest.mark.parametrize("rate_hz", [5.0, 3.0, 2.0, 1.0])
def test_bead_that_comes_off_trips_long_before_the_wire_is_too_hot(rate_hz):
    """A held displacement must not show the colder bead as a strong draft: the wire would reach 132 degC."""
    wire_c = []
    with pytest.raises(TripError):
        track(
            rate_hz,
            lambda bench: bench.sensors.bead.loosen_bead(0.02, over_s=1.0),
            lambda plant, _time_s, _mm: wire_c.append(plant.temperature_c),
            at_s=19.0,
        )
    assert max(wire_c) < load_rig("in-process").limits.temperature_max_c - 15.0
