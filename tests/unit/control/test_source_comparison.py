"""Which one is wrong when a displacement sensor and the resistance differ: the sensor, or the resistance."""

from math import nan, sin
from typing import NamedTuple

import pytest

from smadrive.control.estimation.resistance_sensor import NO_READING, DisplacementReading
from smadrive.control.estimation.source_comparison import RETURNS_TICKS, Compared, SourceComparison

DT_S, STROKE_MM, NOISE_MM = 0.05, 12.0, 0.1
COMPARISON = SourceComparison(STROKE_MM, DT_S)


def reading(mm):
    return NO_READING if mm is None else DisplacementReading(mm, NOISE_MM)


class Motion(NamedTuple):
    """The comparison of the sources along a motion of the wire."""

    ticks: int
    compared: Compared

    def after(self, seconds, sensor, resistance, *, model=lambda right_mm: right_mm):
        """Return the motion and its comparison `seconds` later. A source shows a function of the displacement, or None.

        The model predicts the changes of another function of the displacement.
        """
        (first, compared), count = self, round(seconds / DT_S)
        for tick in range(first, first + count):
            before_mm, right_mm = (6.0 + 3.0 * sin(0.3 * DT_S * t) for t in (tick - 1, tick))
            sources = reading(sensor(right_mm)), reading(resistance(right_mm))
            predicted_mm = model(right_mm) - model(before_mm)
            compared = COMPARISON.update(compared, *sources, predicted_mm, DT_S)
        return Motion(first + count, compared)


def right(right_mm):
    return right_mm


def silent(_right_mm):
    return None


def off_by(offset_mm):
    return lambda right_mm: right_mm + offset_mm


SOUND = Motion(0, Compared()).after(5.0, right, right)


def test_sources_that_agree_are_right():
    assert SOUND.compared.is_confirmed
    assert not SOUND.compared.failed
    assert not SOUND.compared.is_resistance_wrong


@pytest.mark.parametrize("offset_mm", [-1.0, 0.6, 4.0])
def test_sensor_that_slips_has_failed(offset_mm):
    assert SOUND.after(1.0, off_by(offset_mm), right).compared.failed


def test_sensor_that_stands_still_has_failed():
    assert SOUND.after(5.0, lambda _right_mm: 6.0, right).compared.failed


@pytest.mark.parametrize("offset_mm", [-6.0, -1.5, 3.0])
def test_resistance_that_jumps_is_wrong_and_accuses_no_sensor(offset_mm):
    """The model gets a wrong power, too, so the right sensor moves more than it predicts."""
    state = SOUND.after(60.0, right, off_by(offset_mm), model=lambda right_mm: 0.8 * right_mm)
    assert state.compared.is_resistance_wrong
    assert not state.compared.failed


def test_resistance_that_comes_back_far_away_is_wrong_and_accuses_no_sensor():
    """A contact may change so much that the resistance shows nothing for a while, on a warm wire."""
    state = SOUND.after(2.0, right, silent, model=lambda _right_mm: 0.0)
    state = state.after(20.0, right, off_by(-8.0))
    assert state.compared.is_resistance_wrong
    assert not state.compared.failed


def test_resistance_that_drifts_slowly_is_wrong_and_accuses_no_sensor():
    state = SOUND
    for offset_mm in range(30):
        state = state.after(1.0, right, off_by(0.1 * offset_mm), model=lambda right_mm: 0.9 * right_mm)
    assert state.compared.is_resistance_wrong
    assert not state.compared.failed


@pytest.mark.parametrize("offset_mm", [0.5, 1.0, 3.0])
def test_gap_of_the_sensor_over_which_the_difference_stays_accuses_no_sensor(offset_mm):
    """A contact has changed since the identification, or a moment ago."""
    state = Motion(0, Compared()).after(1.0, right, off_by(offset_mm)).after(DT_S, silent, off_by(offset_mm))
    state = state.after(60.0, right, off_by(offset_mm))
    assert state.compared.is_resistance_wrong
    assert not state.compared.is_sensor_wrong


def test_missing_readings_do_not_hide_a_wrong_resistance():
    state = SOUND
    for _ in range(200):
        state = state.after(3 * DT_S, right, off_by(3.0)).after(DT_S, right, silent)
    assert state.compared.is_resistance_wrong


@pytest.mark.parametrize("seconds", [1.0, 5.0, 10.0])
def test_sensor_that_slips_while_the_resistance_of_a_warm_wire_is_not_read_has_failed(seconds):
    gap = SOUND.after(2.0, right, silent).after(seconds, off_by(-4.0), silent)
    assert gap.after(2.0, off_by(-4.0), right).compared.failed


def test_resistance_that_agrees_for_long_enough_is_right_again():
    wrong = SOUND.after(5.0, right, off_by(-6.0))
    soon, later = (wrong.after(seconds, right, right) for seconds in (1.0, 3.0))
    assert soon.compared.is_resistance_wrong
    assert not later.compared.is_resistance_wrong


def test_sensor_that_slips_while_the_wire_is_cold_fails_when_the_wire_is_warm():
    cold = SOUND.after(5.0, right, silent)
    slipped = cold.after(30.0, off_by(-0.8), silent)
    assert not slipped.compared.failed
    assert slipped.after(2.0, off_by(-0.8), right).compared.failed


def test_sensor_that_comes_back_while_the_wire_is_cold_is_confirmed_by_the_first_comparison():
    gap = SOUND.after(5.0, right, silent).after(1.0, silent, silent)
    back = gap.after(30.0, right, silent)
    assert (back.compared.is_confirmed, back.compared.is_sensor_wrong) == (False, False)
    right_again = back.after(DT_S * (RETURNS_TICKS + 1), right, right)
    assert (right_again.compared.is_confirmed, right_again.compared.is_sensor_wrong) == (True, False)
    wrong = back.after(3.0, off_by(-0.8), right)
    assert (wrong.compared.is_confirmed, wrong.compared.is_sensor_wrong) == (False, True)


def test_missing_noise_counts_as_none():
    state = SOUND.after(1.0, right, silent).compared
    assert COMPARISON.update(state, reading(6.0), DisplacementReading(nan, nan), 0.0, DT_S).valid_ticks


BACK = {"has_sensor": True, "is_confirmed": False, "valid_ticks": 21}


@pytest.mark.parametrize(
    ("compared", "is_wrong"),
    [
        ({}, False),
        ({**BACK, "valid_ticks": 0}, False),
        (BACK, False),
        ({**BACK, "disagreement_mm": 1.0}, True),
        ({**BACK, "disagreement_mm": 1.0, "is_confirmed": True}, False),
        ({"has_sensor": True, "failed": True}, True),
    ],
)
def test_sensor_is_wrong_that_has_failed_or_does_not_agree_after_a_gap(compared, is_wrong):
    assert Compared(**compared).is_sensor_wrong is is_wrong
