"""The log: what is written comes back, also when the run ended badly."""

import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.telemetry.log import read_log
from smadrive.telemetry.recorder import FLUSH_ROWS, Recorder


def rows(count):
    return [{"time_s": 0.05 * n, "temperature_c": 20.0 + n, "current_a": 0.1} for n in range(count)]


def test_rows_attributes_and_events_come_back(tmp_path):
    with Recorder(tmp_path / "run.h5", {"rig": "bench"}) as recorder:
        for row in rows(3 * FLUSH_ROWS + 7):
            recorder.row(row)
        recorder.event("fault 1")
    log = read_log(tmp_path / "run.h5")
    np.testing.assert_allclose(log.column("temperature_c"), 20.0 + np.arange(3 * FLUSH_ROWS + 7))
    assert log.attributes["rig"] == "bench"
    assert log.events == ("fault 1",)


def test_units_and_the_common_dimension_are_told(tmp_path):
    with Recorder(tmp_path / "run.h5") as recorder:
        for row in rows(5):
            recorder.row(row)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["temperature_c"].attrs["units"] == "degC"
        assert file["current_a"].attrs["units"] == "A"
        assert file["current_a"].dims[0][0] == file["time_s"]


def test_a_run_that_fails_leaves_a_complete_log_that_says_why(tmp_path):
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.h5") as recorder:  # noqa: PT012
        recorder.row(rows(1)[0])
        raise RuntimeError("unplugged")
    log = read_log(tmp_path / "run.h5")
    assert log.column("time_s").size == 1
    assert log.events == ("RuntimeError: unplugged",)


def test_an_empty_run_is_a_readable_log(tmp_path):
    with Recorder(tmp_path / "run.h5"):
        pass
    assert read_log(tmp_path / "run.h5").columns == {}


def test_what_cannot_be_read_or_written_is_named(tmp_path):
    with pytest.raises(DataError, match="the log cannot be written"):
        Recorder(tmp_path / "no" / "run.h5")
    with pytest.raises(DataError, match="no such file"):
        read_log(tmp_path / "absent.h5")
    (tmp_path / "text.h5").write_text("time_s,temperature_c")
    with pytest.raises(DataError, match="not a readable HDF5 log"):
        read_log(tmp_path / "text.h5")


def test_a_column_that_is_missing_or_not_finite_is_named(tmp_path):
    with Recorder(tmp_path / "run.h5") as recorder:
        recorder.row({"time_s": 0.0, "displacement_mm": float("nan")})
    log = read_log(tmp_path / "run.h5")
    with pytest.raises(DataError, match="did you mean 'displacement_mm'"):
        log.column("displacment_mm")
    with pytest.raises(DataError, match="sample 1, column 'displacement_mm'"):
        log.column("displacement_mm")
    with pytest.raises(DataError, match="nominal_balance"):
        log.json_attribute("nominal_balance")


WRITER = """
import os, signal, sys
from pathlib import Path
from smadrive.telemetry.recorder import Recorder

recorder = Recorder(Path(sys.argv[1]), {"rig": "bench"})
recorder.event("armed")
for n in range(int(sys.argv[2])):
    recorder.row({"time_s": float(n), "current_a": 0.1})
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("rows_written", [FLUSH_ROWS, 5 * FLUSH_ROWS + 13])
def test_a_killed_writer_loses_at_most_what_was_not_flushed(tmp_path, rows_written):
    path = tmp_path / "run.h5"
    killed = subprocess.run([sys.executable, "-c", WRITER, path, str(rows_written)], check=False)
    assert killed.returncode == -signal.SIGKILL
    log = read_log(path)
    np.testing.assert_array_equal(log.column("time_s"), np.arange(rows_written // FLUSH_ROWS * FLUSH_ROWS))
    assert log.attributes["rig"] == "bench"
    assert log.events == ("armed",)
