"""Paths of the identification experiment that are rejected before a log is made."""

import pytest

from smadrive.errors import ConfigError
from smadrive.identification.excitation import LONGEST_S, Excitation, nested_reversals


@pytest.mark.parametrize("rate_c_per_s", [1e-9, 1e-3, 5e-324])
def test_path_longer_than_a_day_is_rejected_with_its_rate(rate_c_per_s):
    with pytest.raises(ConfigError) as error:
        nested_reversals(40.0, 120.0, rate_c_per_s, start_c=22.0)
    assert f"rate_c_per_s = {rate_c_per_s:g}" in error.value.what
    assert error.value.limit == "86400 s"
    assert error.value.cure.startswith("raise rate_c_per_s")


@pytest.mark.parametrize("rate_c_per_s", [0.0, -1.0, float("nan")])
def test_rate_that_is_not_positive_is_rejected(rate_c_per_s):
    with pytest.raises(ConfigError) as error:
        nested_reversals(40.0, 120.0, rate_c_per_s, start_c=22.0)
    assert error.value.where == "excitation.rate_c_per_s"
    assert error.value.value == pytest.approx(rate_c_per_s, nan_ok=True)


@pytest.mark.parametrize("low_c", [-1e308, -1e9])
def test_path_from_an_impossible_temperature_is_rejected(low_c):
    with pytest.raises(ConfigError) as error:
        nested_reversals(low_c, 1e308 if low_c < -1e300 else 120.0, 6.0, start_c=22.0)
    assert error.value.limit == "86400 s"


def test_path_of_a_day_is_accepted():
    assert Excitation((20.0, 20.0 + 0.001 * LONGEST_S), 0.001).duration_s == pytest.approx(LONGEST_S)
