"""A number of a script is checked before it is used: texts, other types and numbers out of bounds are errors."""

from fractions import Fraction

import numpy as np
import pytest

from smadrive.errors import ConfigError, ModelError
from smadrive.numerics.scalars import real_number, whole_number


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), np.int64(2), np.array(2.0), Fraction(2)])
def test_every_type_of_number_is_accepted(value):
    number = real_number(value, "period_s")
    assert (type(number), number) == (float, 2.0)


@pytest.mark.parametrize(("value", "kind"), [("2", "str"), (None, "NoneType"), ([2], "list"), (True, "bool")])
def test_another_type_is_rejected(value, kind):
    with pytest.raises(ModelError) as error:
        real_number(value, "period_s", ModelError)
    assert (error.value.where, error.value.value) == ("period_s", kind)
    assert error.value.cure


def test_number_beyond_all_floats_is_rejected():
    with pytest.raises(ConfigError) as error:
        real_number(10**400, "period_s")
    assert error.value.where == "period_s"
    assert error.value.cure


@pytest.mark.parametrize("value", [2, 4, "3", 2.5, None, True, 10**5000], ids=lambda value: type(value).__name__)
def test_number_that_is_not_whole_or_out_of_bounds_is_rejected(value):
    assert whole_number(np.int64(3), "sets", "sets", 3, 3) == 3
    with pytest.raises(ConfigError) as error:
        whole_number(value, "sets", "sets", 3, 3)
    assert (error.value.where, error.value.limit) == ("sets", "3 to 3")
    assert error.value.cure
