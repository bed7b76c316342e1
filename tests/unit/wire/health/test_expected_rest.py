"""The resistance that the next run is expected to find, and its tolerance."""

from math import nan

import pytest

from smadrive.wire.health.entry import IDENTIFICATION, Estimate, HealthEntry
from smadrive.wire.health.expected_rest import (
    GATE,
    LEAST_RUNS,
    LEAST_TOLERANCE,
    MOST_TOLERANCE,
    RUNS,
    ExpectedRest,
    expected_rest,
)

IDENTIFIED = HealthEntry(kind=IDENTIFICATION, begun="", model="a", rest_ohm=Estimate(10.0, 0.05))
UNSURE = ExpectedRest(10.0, MOST_TOLERANCE)


def run(ohm, spread=0.001, **values):
    return HealthEntry(kind="tracking", begun="", model="a", rest_ohm=Estimate(ohm, 0.05), rest_spread=spread, **values)


@pytest.mark.parametrize(
    "entries",
    [
        [],
        [IDENTIFIED],
        [IDENTIFIED, *[run(10.5)] * (LEAST_RUNS - 1)],
        [IDENTIFIED, *[run(10.5, tripped=True)] * 5],
        [IDENTIFIED.model_copy(update={"model": "b"}), *[run(10.5)] * 5],
        [IDENTIFIED, *[run(10.5)] * 5, IDENTIFIED],
        [IDENTIFIED, *[HealthEntry(kind="tracking", begun="", model="a")] * 5],
        [IDENTIFIED, *[run(10.5, spread=nan)] * 5],
    ],
)
def test_without_enough_sound_runs_only_a_gross_jump_is_one(entries):
    assert expected_rest(entries, "a", 10.0) == UNSURE


def test_runs_without_a_measured_displacement_count():
    estimated = run(nan).model_copy(update={"estimated_rest_ohm": Estimate(10.5, 0.05)})
    found = expected_rest([IDENTIFIED, *[estimated] * LEAST_RUNS], "a", 10.0)
    assert found == ExpectedRest(10.5, LEAST_TOLERANCE)


def test_steady_runs_leave_the_least_tolerance():
    assert expected_rest([IDENTIFIED, *[run(10.5)] * LEAST_RUNS], "a", 10.0) == ExpectedRest(10.5, LEAST_TOLERANCE)


def test_tolerance_follows_the_second_largest_deviation_of_the_last_runs():
    runs = [run(20.0), *[run(10.0)] * (RUNS - 2), run(10.1, spread=0.04), run(12.0, spread=0.2)]
    found = expected_rest([IDENTIFIED, *runs], "a", 10.0)
    assert found.ohm == 10.0
    assert found.tolerance == pytest.approx(GATE * 0.05)


def test_tolerance_has_a_largest_value():
    assert expected_rest([IDENTIFIED, *[run(10.0, spread=0.9)] * 4], "a", 10.0) == UNSURE
