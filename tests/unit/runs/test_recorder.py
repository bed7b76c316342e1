"""Any reader gets from a log what was written, also after a crash of the run or on a full disk."""

import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
from marks import exhaustive

from smadrive.errors import DataError
from smadrive.runs.log.layout import EVENT_ROWS
from smadrive.runs.log.reader import read_log
from smadrive.runs.log.recorder import Recorder
from smadrive.runs.log.writer import GROWTH_ROWS

COLUMNS = ("time_s", "temperature_c", "current_a", "displacement_mm")
ROWS_PER_S = 20


def row(n):
    return 0.05 * n, 20.0 + n, 0.1, float("nan")


def write(path, count, *events, **options):
    with Recorder(path, COLUMNS, {"rig": "bench"}, **options) as recorder:
        for n in range(count):
            recorder.row(row(n))
        for event in events:
            recorder.event(event)
    return read_log(path)


@pytest.mark.parametrize(("count", "expected"), [(67, 67), (67, 5000), (3000, 10), (GROWTH_ROWS + 2000, 100)])
def test_rows_metadata_and_events_are_read_back_for_any_expected_number(tmp_path, count, expected):
    log = write(tmp_path / "run.h5", count, "fault 1: 130 °C", rows=expected)
    np.testing.assert_array_equal(log.column("temperature_c"), 20.0 + np.arange(count))
    np.testing.assert_array_equal(log.column("current_a"), np.full(count, 0.1))
    assert np.isnan(log.columns["displacement_mm"]).all()
    assert log.metadata == {"rig": "bench"}
    assert log.events == ((0.05 * (count - 1), "fault 1: 130 °C"),)
    assert log.start_time <= log.end_time


def test_number_of_events_is_unlimited(tmp_path):
    log = write(tmp_path / "run.h5", 1, *map(str, range(2 * EVENT_ROWS + 1)))
    assert [event.message for event in log.events] == [str(n) for n in range(2 * EVENT_ROWS + 1)]


def test_long_event_is_read_back_whole(tmp_path):
    long = "x" + "°" * 1000
    events = write(tmp_path / "run.h5", 1, "armed", long, "y" * 400, "z" * 401, *[long] * EVENT_ROWS).events
    assert [event.message for event in events] == ["armed", long, "y" * 400, "z" * 401, *[long] * EVENT_ROWS]


def test_parts_of_a_long_event_are_texts_of_the_file(tmp_path):
    write(tmp_path / "run.h5", 1, "x" + "°" * 300)
    with h5py.File(tmp_path / "run.h5") as file:
        parts = file["entry/events/message"].asstr()[:]
    assert [*parts] == ["x" + "°" * 199, "…" + "°" * 101]


def test_names_are_those_of_nexus(tmp_path):
    write(tmp_path / "run.h5", 5)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["default"] == "entry"
        assert file["entry"].attrs["NX_class"] == "NXentry"
        data = file["entry/data"]
        assert data.attrs["NX_class"] == "NXdata"
        assert data.attrs["axes"] == "time_s"
        assert data.attrs["signal"] == "displacement_mm"
        assert {name: column.attrs["units"] for name, column in data.items()} == {
            "time_s": "s",
            "temperature_c": "degC",
            "current_a": "A",
            "displacement_mm": "mm",
        }
        assert data["current_a"].attrs["long_name"] == "current, measured"
        assert file["temperature_c"] == data["temperature_c"]


@pytest.mark.parametrize("group", [None, "entry/data"])
def test_xarray_opens_a_log(tmp_path, group):
    import xarray  # here, because every test process imports this file

    write(tmp_path / "run.h5", 5)
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf", group=group) as data:
        assert float(data["temperature_c"].sel(time_s=0.1)) == 22.0
        assert data["temperature_c"].attrs["units"] == "degC"


def test_failed_run_leaves_a_complete_log_with_the_cause(tmp_path):
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(1))
        error = RuntimeError("unplugged")
        error.add_note("cut the supply")
        raise error
    log = read_log(tmp_path / "run.h5")
    assert log.column("time_s").size == 1
    assert log.ended_by == "RuntimeError: unplugged"
    assert log.events == ((0.05, "ended by RuntimeError: unplugged"), (0.05, "cut the supply"))


def test_empty_run_leaves_a_readable_log(tmp_path):
    assert write(tmp_path / "run.h5", 0).column("time_s").size == 0


def test_log_is_readable_while_it_is_written(tmp_path):
    with Recorder(tmp_path / "run.h5", COLUMNS) as recorder:
        for n in range(3 * ROWS_PER_S + 1):
            recorder.row(row(n))
        log = read_log(tmp_path / "run.h5")
        assert log.column("time_s").size == 3 * ROWS_PER_S + 1
        assert log.end_time == ""
        recorder.row(row(100))
    assert read_log(tmp_path / "run.h5").column("time_s").size == 3 * ROWS_PER_S + 2


def test_log_in_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(DataError) as error:
        Recorder(tmp_path / "no" / "run.h5", COLUMNS)
    assert error.value.where == str(tmp_path / "no" / "run.h5")


def test_file_that_is_not_a_log_is_named(tmp_path):
    (tmp_path / "text.h5").write_text("time_s,temperature_c")
    h5py.File(tmp_path / "foreign.h5", "w").close()
    for name in ("absent.h5", "text.h5", "foreign.h5"):
        with pytest.raises(DataError) as error:
            read_log(tmp_path / name)
        assert error.value.where == str(tmp_path / name)


def test_missing_column_is_named_with_the_nearest_one(tmp_path):
    log = write(tmp_path / "run.h5", 1)
    with pytest.raises(DataError) as error:
        log.column("displacment_mm")
    assert error.value.where == str(log.path)
    assert "'displacement_mm'" in error.value.cure


def test_value_that_is_not_finite_is_named_by_sample_and_column(tmp_path):
    log = write(tmp_path / "run.h5", 1)
    assert np.isnan(log.column_with_gaps("displacement_mm")).all()
    with pytest.raises(DataError) as error:
        log.column("displacement_mm")
    assert error.value.where == f"{log.path}, sample 1, column 'displacement_mm'"
    assert np.isnan(error.value.value)


def test_missing_metadata_are_named(tmp_path):
    with pytest.raises(DataError, match="nominal_balance"):
        write(tmp_path / "run.h5", 1).json("nominal_balance")


CHILD = """
import os, resource, signal, sys
from pathlib import Path
from smadrive.errors import DataError
from smadrive.runs.log.recorder import Recorder

path, count, expected, limit = Path(sys.argv[1]), *map(int, sys.argv[2:])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    with Recorder(path, ("time_s", "current_a"), {"rig": "bench"}, rows=expected) as recorder:
        recorder.event("armed")
        for n in range(count):
            recorder.row((0.05 * n, 0.1))
        if not limit:
            os.kill(os.getpid(), signal.SIGKILL)
except DataError as error:
    print(error)
"""


def in_a_child(path, count, expected, limit=0):
    command = [sys.executable, "-c", CHILD, path, *map(str, (count, expected, limit))]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("count", "expected"), [exhaustive(ROWS_PER_S + 1, 50), exhaustive(213, 5000), (GROWTH_ROWS + 1100, 100)]
)
def test_killed_writer_loses_at_most_a_second(tmp_path, count, expected):
    path = tmp_path / "run.h5"
    assert in_a_child(path, count, expected).returncode == -signal.SIGKILL
    log = read_log(path)
    time_s = log.column("time_s")
    np.testing.assert_array_equal(time_s, 0.05 * np.arange(time_s.size))
    assert count - ROWS_PER_S <= time_s.size <= count
    assert log.column("current_a").size == time_s.size
    assert log.metadata == {"rig": "bench"}
    assert log.events == ((0.0, "armed"),)
    assert log.end_time == ""
    import xarray  # as above

    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.dropna("time_s").sizes["time_s"] == time_s.size


def test_full_disk_is_reported_before_the_run(tmp_path):
    done = in_a_child(tmp_path / "run.h5", 10, 100_000, limit=1_000_000)
    assert done.returncode == 0, done.stderr
    assert "run.h5: the log cannot be written (File too large)" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_disk_that_fills_during_the_run_keeps_the_rows_written(tmp_path):
    path = tmp_path / "run.h5"
    done = in_a_child(path, 3 * GROWTH_ROWS, 100, limit=600_000)
    assert done.returncode == 0, done.stderr
    assert "run.h5: the log cannot be written (File too large)" in done.stdout
    log = read_log(path)
    assert log.column("time_s").size > GROWTH_ROWS
    assert log.ended_by.startswith("DataError: ")
    assert log.end_time


def test_run_that_failed_before_its_first_row_leaves_no_log(tmp_path):
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.h5", COLUMNS):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_log_is_never_written_over(tmp_path):
    write(tmp_path / "run.h5", 5)
    with pytest.raises(DataError) as error:
        Recorder(tmp_path / "run.h5", COLUMNS)
    assert error.value.where == str(tmp_path / "run.h5")
    assert read_log(tmp_path / "run.h5").column("time_s").size == 5
