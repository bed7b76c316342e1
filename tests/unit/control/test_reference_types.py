"""References from a script: arguments that are not numbers are errors that name the argument."""

from inspect import signature
from math import nan

import pytest

from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import SHAPES, parse_reference
from smadrive.errors import ConfigError, DataError

KEYS = [(shape, key) for shape, make in SHAPES.items() for key in signature(make).parameters if key != "longest_s"]


@pytest.mark.parametrize("make", [Reference, Reference.from_samples])
@pytest.mark.parametrize("values", [["2,0", "3,0"], [2, [3]], [2, 10**400]])
def test_samples_that_are_not_numbers_are_rejected(make, values):
    with pytest.raises(DataError) as error:
        make([0, 10], values)
    assert error.value.where == "reference: displacement_mm"
    assert error.value.cure


@pytest.mark.parametrize("value", ["20", None, [20], 10**400])
@pytest.mark.parametrize(("shape", "key"), KEYS)
def test_key_that_is_not_a_number_is_rejected(shape, key, value):
    numbers = {name: 1.0 for other, name in KEYS if other == shape}
    with pytest.raises(ConfigError) as error:
        SHAPES[shape](**{**numbers, key: value})
    assert error.value.where == f"reference: {key}"
    assert error.value.cure


@pytest.mark.parametrize("repeats", ["3", 0, 1.5])
def test_number_of_cycles_that_is_not_whole_is_rejected(repeats):
    with pytest.raises(ConfigError) as error:
        Reference.from_samples([0, 10], [2, 3]).repeated(repeats, 10.0)
    assert error.value.where == "repeats"


@pytest.mark.parametrize(("shape", "key"), KEYS)
def test_nan_is_not_a_number(shape, key):
    numbers = {name: 1.0 for other, name in KEYS if other == shape}
    with pytest.raises(DataError) as error:
        SHAPES[shape](**{**numbers, key: nan})
    assert error.value.where == f"reference: {key}"
    assert error.value.limit is None


@pytest.mark.parametrize("shape", ["sine:period_s=20", "chirp:start_hz=0.1,end_hz=0.2", "staircase:steps=2"])
def test_equal_levels_are_rejected(shape):
    with pytest.raises(ConfigError) as error:
        parse_reference(f"{shape},low_mm=5,high_mm=5")
    assert (error.value.where, error.value.value) == ("reference: high_mm", "5 mm")
    assert error.value.cure


def test_trapezoid_holds_one_level():
    assert parse_reference("trapezoid:low_mm=5,high_mm=5").value_mm(7.0) == 5.0


@pytest.mark.parametrize(
    ("arguments", "value"),
    [
        ("low_mm=1,5,high_mm=3,period_s=5", "1,5"),
        ("low_mm=1,high_mm=3,period_s=10,5", "10,5"),
        ("low_mm=1;high_mm=3;period_s=5", "';'"),
        ("low_mm=1,5;high_mm=3;period_s=5", "';'"),
    ],
)
def test_decimal_comma_and_semicolon_are_named(arguments, value):
    with pytest.raises(ConfigError) as error:
        parse_reference(f"sine:{arguments}")
    assert error.value.value == value
    assert error.value.cure
