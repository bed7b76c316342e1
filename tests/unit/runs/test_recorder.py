"""The log: what is written comes back, in any reader, also when the run or the disk ended badly."""

import os
import shutil
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
import xarray

from smadrive.errors import DataError
from smadrive.runs.log.layout import EVENT_ROWS
from smadrive.runs.log.reader import read_log
from smadrive.runs.log.writer import GROWTH_ROWS
from smadrive.runs.recorder import Recorder

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
def test_rows_texts_and_events_come_back_however_many_were_expected(tmp_path, count, expected):
    log = write(tmp_path / "run.h5", count, "fault 1: 130 °C", rows=expected)
    np.testing.assert_array_equal(log.column("temperature_c"), 20.0 + np.arange(count))
    np.testing.assert_array_equal(log.column("current_a"), np.full(count, 0.1))
    assert np.isnan(log.columns["displacement_mm"]).all()
    assert log.about == {"rig": "bench"}
    assert log.events == ((0.05 * (count - 1), "fault 1: 130 °C"),)
    assert log.start_time <= log.end_time


def test_there_is_no_end_to_events(tmp_path):
    log = write(tmp_path / "run.h5", 1, *map(str, range(2 * EVENT_ROWS + 1)))
    assert [event.message for event in log.events] == [str(n) for n in range(2 * EVENT_ROWS + 1)]


def test_a_long_event_is_cut_between_letters(tmp_path):
    (event,) = write(tmp_path / "run.h5", 1, "x" + "°" * 1000).events
    assert event.message == "x" + "°" * 199


def test_the_names_are_those_of_nexus(tmp_path):
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
        assert file["temperature_c"] == data["temperature_c"]


@pytest.mark.parametrize("group", [None, "entry/data"])
def test_xarray_opens_it(tmp_path, group):
    write(tmp_path / "run.h5", 5)
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf", group=group) as data:
        assert float(data["temperature_c"].sel(time_s=0.1)) == 22.0
        assert data["temperature_c"].attrs["units"] == "degC"


def test_a_run_that_fails_leaves_a_complete_log_that_says_why(tmp_path):
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(1))
        error = RuntimeError("unplugged")
        error.add_note("cut the supply")
        raise error
    log = read_log(tmp_path / "run.h5")
    assert log.column("time_s").size == 1
    assert log.ended_by == "RuntimeError: unplugged"
    assert log.events == ((0.05, "ended by RuntimeError: unplugged"), (0.05, "cut the supply"))


def test_an_empty_run_is_a_readable_log(tmp_path):
    assert write(tmp_path / "run.h5", 0).column("time_s").size == 0


def test_a_log_can_be_read_while_it_is_written(tmp_path):
    with Recorder(tmp_path / "run.h5", COLUMNS) as recorder:
        for n in range(3 * ROWS_PER_S + 1):
            recorder.row(row(n))
        log = read_log(tmp_path / "run.h5")
        assert log.column("time_s").size == 3 * ROWS_PER_S + 1
        assert log.end_time == ""
        recorder.row(row(100))
    assert read_log(tmp_path / "run.h5").column("time_s").size == 3 * ROWS_PER_S + 2


def test_what_cannot_be_read_or_written_is_named(tmp_path):
    with pytest.raises(DataError, match=r"no/run\.h5: cannot be written"):
        Recorder(tmp_path / "no" / "run.h5", COLUMNS)
    with pytest.raises(DataError, match="no such file"):
        read_log(tmp_path / "absent.h5")
    (tmp_path / "text.h5").write_text("time_s,temperature_c")
    with pytest.raises(DataError, match="not a readable log of smadrive: give one"):
        read_log(tmp_path / "text.h5")
    h5py.File(tmp_path / "foreign.h5", "w").close()
    with pytest.raises(DataError, match="not a readable log"):
        read_log(tmp_path / "foreign.h5")


def test_a_column_that_is_missing_or_not_finite_is_named(tmp_path):
    log = write(tmp_path / "run.h5", 1)
    with pytest.raises(DataError, match="did you mean 'displacement_mm'"):
        log.column("displacment_mm")
    with pytest.raises(DataError, match="sample 1, column 'displacement_mm'"):
        log.column("displacement_mm")
    with pytest.raises(DataError, match="nominal_balance"):
        log.json("nominal_balance")


CHILD = """
import os, resource, signal, sys
from pathlib import Path
from smadrive.errors import DataError
from smadrive.runs.recorder import Recorder

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


@pytest.mark.parametrize(("count", "expected"), [(ROWS_PER_S + 1, 50), (213, 5000), (GROWTH_ROWS + 1100, 100)])
def test_a_killed_writer_loses_at_most_a_second(tmp_path, count, expected):
    path = tmp_path / "run.h5"
    assert in_a_child(path, count, expected).returncode == -signal.SIGKILL
    log = read_log(path)
    time_s = log.column("time_s")
    np.testing.assert_array_equal(time_s, 0.05 * np.arange(time_s.size))
    assert count - ROWS_PER_S <= time_s.size <= count
    assert log.column("current_a").size == time_s.size
    assert log.about == {"rig": "bench"}
    assert log.events == ((0.0, "armed"),)
    assert log.end_time == ""
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.dropna("time_s").sizes["time_s"] == time_s.size


def test_a_disk_without_room_is_told_before_the_run(tmp_path):
    done = in_a_child(tmp_path / "run.h5", 10, 100_000, limit=1_000_000)
    assert done.returncode == 0, done.stderr
    assert "run.h5: the log takes no more (File too large): check the folder and its space" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_during_the_run_leaves_what_it_took(tmp_path):
    path = tmp_path / "run.h5"
    done = in_a_child(path, 3 * GROWTH_ROWS, 100, limit=600_000)
    assert done.returncode == 0, done.stderr
    assert "run.h5: the log takes no more (File too large)" in done.stdout
    log = read_log(path)
    assert log.column("time_s").size > GROWTH_ROWS
    assert log.ended_by.startswith("DataError: ")
    assert log.end_time


def test_a_run_that_failed_before_its_first_row_leaves_no_log(tmp_path):
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.h5", COLUMNS):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_log_is_not_written_over(tmp_path):
    write(tmp_path / "run.h5", 5)
    with pytest.raises(DataError, match="exists"):
        Recorder(tmp_path / "run.h5", COLUMNS)
    assert read_log(tmp_path / "run.h5").column("time_s").size == 5


def _remove(path):
    path.unlink()


def _remove_folder(path):
    shutil.rmtree(path.parent)


def _move(path):
    path.rename(path.with_name("moved.h5"))


def _empty(path):
    os.truncate(path, 0)


def _halve(path):
    os.truncate(path, path.stat().st_size // 2)


def _overwrite(path):
    path.write_bytes(bytes(path.stat().st_size))


def _replace(path):
    """As `rsync` and editors save: a copy takes the name."""
    shutil.copy(path, path.with_name("copy.h5")).rename(path)


def _put_a_file_in_place_of_the_folder(path):
    shutil.rmtree(path.parent)
    path.parent.touch()


HARMS = [(_remove, "gone"), (_remove_folder, "gone"), (_move, "gone"), (_replace, "gone, removed, moved or replaced")]
HARMS += [(_put_a_file_in_place_of_the_folder, "gone")]
HARMS += [(_empty, "cut or written over"), (_halve, "cut or written over"), (_overwrite, "cut or written over")]


@pytest.mark.parametrize("rows_after", [0, 1, 2 * ROWS_PER_S, 2 * GROWTH_ROWS])
@pytest.mark.parametrize(("harm", "told"), HARMS)
def test_a_log_that_another_program_harms_is_told_in_a_sentence(tmp_path, harm, told, rows_after):
    path = tmp_path / "logs" / "run.h5"
    path.parent.mkdir()
    with pytest.raises(DataError, match=rf"^\S*run\.h5: the log .*{told}.* then run again$") as caught:  # noqa: PT012, SIM117
        with Recorder(path, COLUMNS) as recorder:
            for n in range(2 * ROWS_PER_S):
                recorder.row(row(n))
            harm(path)
            for n in range(rows_after):
                recorder.row(row(2 * ROWS_PER_S + n))
    assert not hasattr(caught.value, "__notes__")


@pytest.mark.parametrize("rows_before", [0, 1])
def test_what_took_the_name_of_a_log_is_neither_cut_nor_removed(tmp_path, rows_before):
    path = tmp_path / "run.h5"
    with pytest.raises(RuntimeError, match="unplugged"), Recorder(path, COLUMNS) as recorder:  # noqa: PT012
        for n in range(rows_before):
            recorder.row(row(n))
        _replace(path)
        stranger = path.read_bytes()
        raise RuntimeError("unplugged")
    assert path.read_bytes() == stranger


def test_a_log_that_was_replaced_takes_no_event(tmp_path):
    with pytest.raises(DataError, match="gone"), Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(0))
        recorder.flush()
        _replace(tmp_path / "run.h5")
        recorder.event("faults: none any more")


def test_what_ended_a_run_is_told_although_its_log_is_gone(tmp_path):
    with pytest.raises(RuntimeError, match="unplugged") as caught, Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(1))
        (tmp_path / "run.h5").unlink()
        raise RuntimeError("unplugged")
    assert "the log is gone" in caught.value.__notes__[0]
