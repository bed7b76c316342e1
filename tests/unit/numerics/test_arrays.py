"""Conversion of samples to arrays of floats: what is not plainly a number is refused."""

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.numerics.arrays import float_array


@pytest.mark.parametrize("values", [[1, 2.5], np.ma.array([1, 2.5]), np.array([True, False]), 3, [[1, 2], [3, 4]]])
def test_numbers_become_a_copy_of_floats(values):
    array = float_array("y", values)
    assert type(array) is np.ndarray
    assert array.dtype == np.float64
    np.testing.assert_array_equal(array, np.asarray(values, dtype=float))
    assert not np.shares_memory(array, np.asarray(values))


@pytest.mark.parametrize(
    "values",
    [
        np.ma.array([2.0, 11.0, 3.0], mask=[False, True, False]),
        np.array([0, 20_000], dtype="timedelta64[ms]"),
        np.array(["2026-01-01"], dtype="datetime64[ms]"),
        np.array([1.0 + 2.0j]),
        [[1, 2], [3]],
        ["one"],
        [10**400],
    ],
    ids=["masked", "durations", "dates", "complex", "ragged", "words", "too large"],
)
def test_what_would_lose_its_meaning_is_refused(values):
    with pytest.raises(DataError) as caught:
        float_array("y", values)
    assert caught.value.where == "y"
