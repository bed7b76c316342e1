"""A displacement that is read more slowly than the loop runs belongs to the time at which it was read."""

from pathlib import Path

import numpy as np
import pytest

from smadrive.runs.log.reader import Log
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import RECORDED, displacement_in_time, excitation_record

TIME_S = np.arange(0.0, 10.0, 0.05)


def position_mm(time_s):
    return 3.0 + 0.5 * time_s


def log(age_s, **changed):
    """The log of a steady motion whose displacement has the age `age_s`."""
    columns = {name: np.ones_like(TIME_S) for name in RECORDED}
    columns |= {"time_s": TIME_S, "displacement_mm": position_mm(TIME_S - age_s), "displacement_age_s": age_s}
    return Log(Path("e.h5"), columns | changed, {"kind": RunKind.EXCITATION}, (), "", "", "")


@pytest.mark.parametrize("slower", [1, 4, 7])
def test_displacement_is_that_at_the_time_of_the_row(slower):
    age_s = 0.02 + 0.05 * (np.arange(TIME_S.size) % slower)
    moved_mm = displacement_in_time(log(age_s))
    between = slice(1, -8)
    np.testing.assert_allclose(moved_mm[between], position_mm(TIME_S)[between])
    np.testing.assert_array_equal(excitation_record(log(age_s)).displacement_mm, moved_mm)


def test_displacement_without_age_is_unchanged():
    now = log(np.zeros_like(TIME_S))
    np.testing.assert_array_equal(displacement_in_time(now), now.columns["displacement_mm"])
    columns = {name: values for name, values in now.columns.items() if name != "displacement_age_s"}
    old = Log(now.path, columns, now.metadata, (), "", "", "")
    np.testing.assert_array_equal(displacement_in_time(old), now.columns["displacement_mm"])


def test_row_without_a_valid_reading_stays_without():
    age_s = np.full_like(TIME_S, 0.1)
    age_s[:3] = np.inf
    displacement_mm = position_mm(TIME_S - 0.1)
    displacement_mm[[0, 1, 2, 50]] = np.nan
    moved_mm = displacement_in_time(log(age_s, displacement_mm=displacement_mm))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(moved_mm)), [0, 1, 2, 50])
    nothing = displacement_in_time(log(age_s, displacement_mm=np.full_like(TIME_S, np.nan)))
    assert np.isnan(nothing).all()
