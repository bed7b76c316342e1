"""Another program removes, moves, replaces or cuts the log during a run: the run ends and nothing else is harmed."""

import os
import shutil

import pytest

from smadrive.errors import DataError
from smadrive.runs.log.recorder import Recorder
from smadrive.runs.log.writer import GROWTH_ROWS

COLUMNS = ("time_s", "temperature_c")
ROWS_PER_S = 20


def row(n):
    return 0.05 * n, 20.0 + n


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
    """Put a copy in the place of the file, as `rsync` and editors do."""
    shutil.copy(path, path.with_name("copy.h5")).rename(path)


def _put_a_file_in_place_of_the_folder(path):
    shutil.rmtree(path.parent)
    path.parent.touch()


HARMS = [(harm, "removed") for harm in (_remove, _remove_folder, _move, _replace, _put_a_file_in_place_of_the_folder)]
HARMS += [(harm, "cut") for harm in (_empty, _halve, _overwrite)]


@pytest.mark.parametrize("rows_after", [0, 1, 2 * ROWS_PER_S, 2 * GROWTH_ROWS])
@pytest.mark.parametrize(("harm", "damage"), HARMS)
def test_log_that_another_program_damages_ends_the_run(tmp_path, harm, damage, rows_after):
    path = tmp_path / "logs" / "run.h5"
    path.parent.mkdir()
    with pytest.raises(DataError) as caught:  # noqa: PT012, SIM117
        with Recorder(path, COLUMNS) as recorder:
            for n in range(2 * ROWS_PER_S):
                recorder.row(row(n))
            harm(path)
            for n in range(rows_after):
                recorder.row(row(2 * ROWS_PER_S + n))
    assert caught.value.where == str(path)
    assert damage in caught.value.what
    assert not hasattr(caught.value, "__notes__")


@pytest.mark.parametrize("rows_before", [0, 1])
def test_file_that_replaced_a_log_is_neither_cut_nor_removed(tmp_path, rows_before):
    path = tmp_path / "run.h5"
    with pytest.raises(RuntimeError, match="unplugged"), Recorder(path, COLUMNS) as recorder:  # noqa: PT012
        for n in range(rows_before):
            recorder.row(row(n))
        _replace(path)
        replacement = path.read_bytes()
        raise RuntimeError("unplugged")
    assert path.read_bytes() == replacement


def test_replaced_log_takes_no_event(tmp_path):
    with pytest.raises(DataError) as caught, Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(0))
        recorder.flush()
        _replace(tmp_path / "run.h5")
        recorder.event("faults: cleared")
    assert caught.value.where == str(tmp_path / "run.h5")
    assert "replaced" in caught.value.what


def test_error_that_ended_a_run_is_raised_although_its_log_is_lost(tmp_path):
    with pytest.raises(RuntimeError, match="unplugged") as caught, Recorder(tmp_path / "run.h5", COLUMNS) as recorder:  # noqa: PT012
        recorder.row(row(1))
        (tmp_path / "run.h5").unlink()
        raise RuntimeError("unplugged")
    assert "run.h5" in caught.value.__notes__[0]
