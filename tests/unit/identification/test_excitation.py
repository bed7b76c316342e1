"""The path of the identification experiment: what is refused before a log is made for it."""

import pytest

from smadrive.errors import ConfigError
from smadrive.identification.excitation import LONGEST_S, Excitation, nested_reversals


@pytest.mark.parametrize("rate_c_per_s", [1e-9, 1e-3, 5e-324])
def test_a_path_of_more_than_a_day_is_refused_with_a_word_about_its_rate(rate_c_per_s):
    with pytest.raises(ConfigError, match=rf"rate_c_per_s = {rate_c_per_s:g} .* the longest is 86400 s.* raise"):
        nested_reversals(40.0, 120.0, rate_c_per_s, start_c=22.0)


@pytest.mark.parametrize("rate_c_per_s", [0.0, -1.0, float("nan")])
def test_a_path_that_stands_still_is_refused(rate_c_per_s):
    with pytest.raises(ConfigError, match="rate_c_per_s must be positive"):
        nested_reversals(40.0, 120.0, rate_c_per_s, start_c=22.0)


@pytest.mark.parametrize("low_c", [-1e308, -1e9])
def test_a_path_from_nowhere_is_refused(low_c):
    with pytest.raises(ConfigError, match="the longest is 86400 s"):
        nested_reversals(low_c, 1e308 if low_c < -1e300 else 120.0, 6.0, start_c=22.0)


def test_a_day_is_taken():
    assert Excitation((20.0, 20.0 + 0.001 * LONGEST_S), 0.001).duration_s == pytest.approx(LONGEST_S)
