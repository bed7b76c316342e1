"""Logs of version 0.1 are read, reported and replayed; logs of a later version are refused."""

import csv

import h5py
import numpy as np
import pytest
from benchmarks.oldlog import to_layout_1, without_checksums
from marks import exhaustive

from smadrive.cli.views.reports.log_report import write_log_report
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import DataError
from smadrive.files.csv_table import write_table
from smadrive.hysteresis import DuhemModel
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.old_layouts import COLUMNS_OF_1, LAYOUT
from smadrive.runs.log.reader import read_log
from smadrive.runs.replay import replay
from smadrive.runs.run_log import record_tracking
from smadrive.wire.wire_model import WireModel

WIRE = DuhemModel.gaussian(
    mu_heating=93, mu_cooling=71, sigma_heating=6, sigma_cooling=6, scale=11, input_range=(20, 130)
)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """The log of a short tracking run in the present layout."""
    path = tmp_path_factory.mktemp("tracked") / "run.h5"
    reference = sine(low_mm=1.0, high_mm=8.0, period_s=10.0, cycles=0.5).with_approach(0.0, 2.0)
    with Rig(load_rig("in-process")) as rig:
        experiment = reference, WireModel(WIRE, rig.nominal_balance), HysteresisInverse(WIRE)
        with record_tracking(path, rig, *experiment, seed="0") as recorder:
            rig.track(*experiment, recorder.tick)
            recorder.event("an event")
    return path


@pytest.fixture(params=[to_layout_1, exhaustive(without_checksums)])
def old(request, tracked, tmp_path):
    path = tmp_path / "old.h5"
    path.write_bytes(tracked.read_bytes())
    request.param(path)
    return path


def test_old_log_has_the_old_names(old):
    with h5py.File(old) as file:
        assert set(COLUMNS_OF_1) < set(file["entry/data"])
        assert not set(COLUMNS_OF_1.values()) & set(file)
        assert "rig" in file["entry/about"]


def test_old_log_is_read_under_the_names_of_today(old, tracked):
    log, expected = read_log(old), read_log(tracked)
    assert set(log.columns) == set(expected.columns) - {"temperature_fault"}
    for name, values in log.columns.items():
        np.testing.assert_array_equal(values, expected.columns[name])
    assert log.metadata == expected.metadata
    assert log.events == expected.events
    assert (log.start_time, log.end_time, log.version) == (expected.start_time, expected.end_time, "0.1.0")


def test_old_log_is_replayed_bit_for_bit(old):
    assert replay(read_log(old)).exact


@pytest.mark.exhaustive
def test_old_log_is_reported(old, tracked, tmp_path):
    log = read_log(old)
    assert write_log_report(tmp_path / "old.html", log) == write_log_report(tmp_path / "new.html", read_log(tracked))
    write_table(tmp_path / "old.csv", {}, log.columns)
    with (tmp_path / "old.csv").open() as file:
        assert {"setpoint_mm", "setpoint_c"} < set(next(csv.reader(file)))


def test_damage_is_found_in_an_old_log_with_checksums(tracked, tmp_path):
    path = tmp_path / "old.h5"
    path.write_bytes(tracked.read_bytes())
    to_layout_1(path)
    with h5py.File(path, "r+") as file:
        file["reference_mm"][3] += 1e-9
    with pytest.raises(DataError) as error:
        read_log(path)
    assert error.value.where == f"{path}, sample 4"


def test_log_of_a_later_layout_is_refused_with_the_way_to_convert_it(tracked, tmp_path):
    path = tmp_path / "later.h5"
    path.write_bytes(tracked.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["layout"] = LAYOUT + 1
    with pytest.raises(DataError) as error:
        read_log(path)
    assert (error.value.where, error.value.limit) == (str(path), LAYOUT)
    assert "update smadrive" in error.value.cure
    assert "CSV" in error.value.cure
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("layout", [0, -1, "two", [1, 2], 1.5])
def test_damaged_number_of_the_layout_is_refused(tracked, tmp_path, layout):
    path = tmp_path / "damaged.h5"
    path.write_bytes(tracked.read_bytes())
    with h5py.File(path, "r+") as file:
        del file.attrs["layout"]
        file.attrs["layout"] = layout
    with pytest.raises(DataError):
        read_log(path)
