"""A replay is identical to the record; with another model or rig file it shows the differences."""

import json
from dataclasses import replace
from math import inf, nan

import numpy as np
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
from smadrive.wire.wire_model import WireModel


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


def test_wrong_model_predicts_worse_without_the_displacement(tracked):
    blind = replace(
        tracked, columns={**tracked.columns, "displacement_mm": np.full_like(tracked.columns["time_s"], nan)}
    )
    balance = Rig(load_rig("in-process")).nominal_balance
    misses = []
    for model in (wire(mu_heating=90.0), wire(mu_heating=99.0)):
        estimated_mm = replay(blind, IdentifiedWire(model, balance)).columns["estimated_mm"]
        misses.append(prediction_percent(tracked, estimated_mm, model))
    assert misses[1] > 2.0 * misses[0]


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
