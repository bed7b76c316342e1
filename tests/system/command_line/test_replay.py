"""A replay is identical to the record; with another model or rig file it shows the differences."""

import json
import sys
from dataclasses import replace
from math import inf, isnan, nan

import numpy as np
import programs
import pytest

from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.control.references.shapes import sine
from smadrive.errors import DataError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.replay import Difference, prediction_percent, replay
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.wire_model import WireModel, travel_mm


def wire(mu_heating=93.0):
    return DuhemModel.gaussian(
        mu_heating=mu_heating,
        mu_cooling=71.0,
        sigma_heating=6.0,
        sigma_cooling=6.0,
        scale=11.0,
        input_range=(20.0, 130.0),
    )


def track(path, inverse=None, until_s=inf):
    """Record a short tracking run, which Ctrl-C ends at `until_s`."""
    model = wire()
    reference = sine(low_mm=1.0, high_mm=8.0, period_s=20.0, cycles=1.0).with_approach(0.0, 5.0)

    def record(tick):
        recorder.tick(tick)
        if tick.time_s >= until_s:
            raise KeyboardInterrupt

    with Rig(load_rig("in-process")) as rig:
        experiment = reference, WireModel(model, rig.nominal_balance), inverse or HysteresisInverse(model)
        with record_tracking(path, rig, *experiment) as recorder:
            rig.track(*experiment, record)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    path = tmp_path_factory.mktemp("tracked") / "run.h5"
    track(path)
    return read_log(path)


def test_replay_of_a_tracking_run_is_the_record(tracked):
    again = replay(tracked)
    assert again.exact
    for name, values in again.columns.items():
        np.testing.assert_array_equal(values, tracked.columns[name])
        assert again.differences[name] == Difference(max=0.0, rms=0.0, first_s=inf)


def test_wire_without_a_heat_balance_has_that_of_the_data_sheet_as_in_the_run(tracked):
    hysteresis_alone = IdentifiedWire(wire())
    assert replay(tracked, hysteresis_alone).exact
    assert prediction_percent(tracked, hysteresis_alone) == prediction_percent(tracked)


@pytest.mark.exhaustive
def test_replay_of_an_excitation_is_the_record(tmp_path):
    path = tmp_path / "excitation.h5"
    with Rig(load_rig("in-process")) as rig:
        excitation = rig.excitation(22.0)
        with record_excitation(path, rig, excitation) as recorder:
            rig.excite(excitation, recorder.tick)
    log = read_log(path)
    assert replay(log).exact
    with pytest.raises(DataError) as error:
        replay(log, IdentifiedWire(wire(), Rig(load_rig("in-process")).nominal_balance))
    assert error.value.where == str(path)
    assert "--model" in error.value.cure


def test_replay_of_a_stopped_run_is_its_record(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        track(tmp_path / "run.h5", until_s=7.0)
    log = read_log(tmp_path / "run.h5")
    assert log.column("time_s")[-1] == pytest.approx(7.0, abs=0.06)
    assert replay(log).exact


def test_another_model_differs_in_its_setpoint(tracked):
    far = wire(mu_heating=99.0)
    again = replay(tracked, IdentifiedWire(far, Rig(load_rig("in-process")).nominal_balance))
    assert not again.exact
    assert again.differences["setpoint_mm"].first_s == inf
    assert again.differences["setpoint_c"].max > 4.0
    assert again.differences["setpoint_c"].rms > 1.0


def test_command_shows_how_much_worse_a_wrong_model_predicts(tracked, tmp_path):
    """The sensor has corrected the estimates of the run, and corrects those of the replay with the wrong model."""
    far = IdentifiedWire(wire(mu_heating=99.0), Rig(load_rig("in-process")).nominal_balance)
    far.save(tmp_path / "far.json")
    command = [sys.executable, "-m", "smadrive", "replay", tracked.path, "--model", "far.json", "--json"]
    done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    predictions = json.loads(done.stdout)["prediction_percent"]
    assert predictions["replayed"] > predictions["recorded"] + 10.0
    assert predictions["recorded"] == prediction_percent(tracked)
    assert predictions["replayed"] == prediction_percent(tracked, far)


@pytest.mark.parametrize("mu_heating", [90.0, 99.0])
def test_prediction_is_the_estimate_of_a_run_without_a_source_of_the_displacement(tracked, mu_heating):
    identified = IdentifiedWire(wire(mu_heating), Rig(load_rig("in-process")).nominal_balance)
    without = replace(tracked, metadata={**tracked.metadata, "displacement_from": "none"})
    apart_mm = replay(without, identified).columns["estimated_mm"] - tracked.columns["displacement_mm"]
    expected_percent = 100.0 * np.sqrt(np.mean(apart_mm**2)) / travel_mm(identified.model).stroke_mm
    assert prediction_percent(tracked, identified) == pytest.approx(expected_percent)


def test_prediction_is_unknown_when_a_displacement_is_missing(tracked):
    displacement_mm = tracked.columns["displacement_mm"].copy()
    displacement_mm[7] = nan
    gap = replace(tracked, columns={**tracked.columns, "displacement_mm": displacement_mm})
    assert isnan(prediction_percent(gap))


def test_changed_rig_file_shows_from_the_first_tick_that_differs(tracked):
    rig = tracked.json("rig")
    rig["feedback"]["closed_loop_s"] *= 2.0
    again = replay(replace(tracked, metadata={**tracked.metadata, "rig": json.dumps(rig)}))
    assert again.differences["estimated_mm"].first_s == inf
    assert 0.0 <= again.differences["power_w"].first_s < 1.0


def test_run_with_a_plain_map_is_replayed_with_a_model_alone(tmp_path):
    track(tmp_path / "map.h5", StaticMap([20.0, 80.0, 130.0], [0.0, 5.0, 11.0]))
    log = read_log(tmp_path / "map.h5")
    with pytest.raises(DataError) as error:
        replay(log)
    assert error.value.where == str(log.path)
    assert "--model" in error.value.cure
    assert not replay(log, IdentifiedWire(wire(), Rig(load_rig("in-process")).nominal_balance)).exact
