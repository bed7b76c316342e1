"""The plans of the identification experiment, the time that they take, and paths that are rejected before a log."""

from math import ceil
from typing import get_args

import numpy as np
import pytest

from smadrive.errors import ConfigError
from smadrive.identification.excitation import LONGEST_S, Excitation, path_length_k
from smadrive.identification.excitation_plans import (
    FALLING_PER_RISING,
    FOOT_SHARE,
    MOST_REVERSALS,
    PLANS,
    planned_excitation,
)
from smadrive.rig.config import ExcitationConfig

LOW_C, HIGH_C, RATE, START_C = 40.0, 120.0, 6.0, 22.0
RANGE = {"low_c": LOW_C, "high_c": HIGH_C, "rate_c_per_s": RATE}
EVERY_PLAN = pytest.mark.parametrize("plan", PLANS)


def planned(plan, **size):
    return planned_excitation(plan, LOW_C, HIGH_C, RATE, START_C, **size)


def curves(excitation):
    """Return the reversal temperatures of the falling curves and of the rising curves."""
    points = excitation.turning_points_c
    corners = list(zip(points, points[1:], points[2:], strict=False))
    falling = [at for before, at, after in corners if before == after == LOW_C and at < HIGH_C]
    rising = [at for before, at, after in corners if before == after == HIGH_C and at > LOW_C]
    return falling, rising


@pytest.mark.parametrize("rate_c_per_s", [1e-9, 1e-3, 5e-324])
def test_path_longer_than_a_day_is_rejected_with_its_rate(rate_c_per_s):
    with pytest.raises(ConfigError) as error:
        planned_excitation("nested", 40.0, 120.0, rate_c_per_s, start_c=22.0)
    assert f"rate_c_per_s = {rate_c_per_s:g}" in error.value.what
    assert error.value.limit == "86400 s"
    assert error.value.cure.startswith("raise rate_c_per_s")


@pytest.mark.parametrize("rate_c_per_s", [0.0, -1.0, float("nan")])
def test_rate_that_is_not_positive_is_rejected(rate_c_per_s):
    with pytest.raises(ConfigError) as error:
        planned_excitation("nested", 40.0, 120.0, rate_c_per_s, start_c=22.0)
    assert error.value.where == "excitation.rate_c_per_s"
    assert error.value.value == pytest.approx(rate_c_per_s, nan_ok=True)


@pytest.mark.parametrize("low_c", [-1e308, -1e9])
def test_path_from_an_impossible_temperature_is_rejected(low_c):
    with pytest.raises(ConfigError) as error:
        planned_excitation("nested", low_c, 1e308 if low_c < -1e300 else 120.0, 6.0, start_c=22.0)
    assert error.value.limit == "86400 s"


def test_path_of_a_day_is_accepted():
    assert Excitation((20.0, 20.0 + 0.001 * LONGEST_S), 0.001).duration_s == pytest.approx(LONGEST_S)


def test_config_has_the_plans_and_accepts_every_number_that_is_planned():
    assert get_args(ExcitationConfig.model_fields["plan"].annotation) == tuple(PLANS)
    for number in (MOST_REVERSALS, *(plan.fewest for plan in PLANS.values())):
        assert ExcitationConfig(**RANGE, reversals=number).reversals == number


def test_default_is_the_path_of_five_nested_reversals():
    excitation = planned("nested")
    assert excitation == planned("nested", reversals=5)
    assert excitation.turning_points_c[:5] == (START_C, HIGH_C, LOW_C, HIGH_C, LOW_C)
    assert (excitation.plan, excitation.reversal_curves) == ("nested", 20)


@pytest.mark.parametrize("reversals", [2, 5, 15, MOST_REVERSALS])
def test_first_order_reversal_curves_begin_on_the_major_loop(reversals):
    excitation = planned("forc", reversals=reversals)
    falling, rising = curves(excitation)
    assert excitation.turning_points_c[:3] == (START_C, HIGH_C, LOW_C)
    assert excitation.turning_points_c[-1] == LOW_C
    assert (len(falling), len(rising)) == (reversals, ceil(reversals / FALLING_PER_RISING))
    assert (excitation.plan, excitation.reversal_curves) == ("forc", len(falling) + len(rising))


def test_reversal_temperatures_are_evenly_spaced_and_leave_out_foot_and_head():
    falling, rising = curves(planned("forc", reversals=12))
    foot_k = FOOT_SHARE * (HIGH_C - LOW_C)
    for temperatures_c, low_c, high_c in ((falling, LOW_C + foot_k, HIGH_C), (rising, LOW_C, HIGH_C - foot_k)):
        spaces_k = np.diff([low_c, *sorted(temperatures_c), high_c])
        assert spaces_k == pytest.approx((high_c - low_c) / (len(temperatures_c) + 1))


@pytest.mark.parametrize("reversals", [6, 15])
def test_half_of_the_falling_curves_covers_the_range(reversals):
    falling, _ = curves(planned("forc", reversals=reversals))
    first = falling[: ceil(reversals / 2)]
    assert first == sorted(falling)[::2]
    assert falling[len(first) :] == sorted(falling)[1::2][::-1]


@EVERY_PLAN
@pytest.mark.parametrize("duration_s", [260.0, 400.0, 1000.0])
def test_as_many_reversals_as_fit_are_planned(plan, duration_s):
    excitation = planned(plan, duration_s=duration_s)
    fitting = [n for n in range(1, MOST_REVERSALS + 1) if planned(plan, reversals=n).duration_s <= duration_s]
    assert excitation == planned(plan, reversals=fitting[-1])
    assert excitation.duration_s <= duration_s


@EVERY_PLAN
def test_more_reversals_than_the_most_are_not_planned(plan):
    assert planned(plan, duration_s=LONGEST_S) == planned(plan, reversals=MOST_REVERSALS)


@EVERY_PLAN
def test_slow_path_has_as_many_reversals_as_fit_into_a_day(plan):
    slow = planned_excitation(plan, LOW_C, HIGH_C, 0.02, START_C, duration_s=LONGEST_S)
    assert planned(plan, reversals=PLANS[plan].fewest).reversal_curves < slow.reversal_curves
    assert slow.duration_s <= LONGEST_S


@EVERY_PLAN
def test_time_that_is_too_short_is_rejected_with_the_shortest_time(plan):
    shortest = planned(plan, reversals=PLANS[plan].fewest)
    with pytest.raises(ConfigError) as error:
        planned(plan, duration_s=shortest.duration_s - 1.0)
    assert error.value.where == "excitation.duration_s"
    assert error.value.value == f"{shortest.duration_s - 1.0:g} s"
    assert error.value.limit.startswith(f"at least {ceil(shortest.duration_s)} s")
    assert error.value.cure == f"raise duration_s to {ceil(shortest.duration_s)}"
    assert planned(plan, duration_s=ceil(shortest.duration_s)) == shortest


@EVERY_PLAN
def test_invalid_temperature_is_no_error_of_the_plan(plan):
    excitation = planned_excitation(plan, LOW_C, HIGH_C, RATE, float("nan"), duration_s=400.0)
    cold = planned_excitation(plan, LOW_C, HIGH_C, RATE, LOW_C, duration_s=400.0)
    assert excitation.turning_points_c[1:] == cold.turning_points_c[1:]


@EVERY_PLAN
def test_range_without_a_span_is_rejected(plan):
    with pytest.raises(ConfigError) as error:
        planned_excitation(plan, HIGH_C, HIGH_C, RATE, START_C)
    assert error.value.where == "excitation.high_c"


def test_length_of_a_path_counts_both_directions():
    assert path_length_k((20.0, 120.0, 40.0)) == 180.0
