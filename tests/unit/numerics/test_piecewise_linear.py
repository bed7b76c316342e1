"""The piecewise linear function agrees with numpy's interpolation to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from smadrive.numerics.piecewise_linear import PiecewiseLinear


@pytest.mark.parametrize("corners", [2, 3, 50])
def test_value_equals_numpys_interpolation_to_the_last_bit(corners):
    random = np.random.default_rng(corners)
    times_s, values = np.cumsum(random.uniform(0.01, 3.0, corners)), random.normal(40.0, 20.0, corners)
    line = PiecewiseLinear(times_s, values)
    asked_s = np.concatenate((random.uniform(times_s[0] - 1.0, times_s[-1] + 1.0, 2000), times_s, [np.nan]))
    found = [line.at(time_s) for time_s in asked_s.tolist()]
    assert np.array_equal(found, np.interp(asked_s, times_s, values), equal_nan=True)


def test_leg_of_no_length_is_skipped():
    assert PiecewiseLinear([0.0, 0.0, 2.0], [5.0, 5.0, 9.0]).at(1.0) == 7.0
