"""The innovation test: noise, disturbances, and sensors that contradict each other."""

import numpy as np
import pytest

from smadrive.control.estimation.innovation import HOLD_S, MOST_S, Doubt, InnovationTest

PERIOD_S, NOISE_C, NOISE = 0.05, 0.1, 0.001


@pytest.fixture
def test():
    return InnovationTest(PERIOD_S, NOISE_C, NOISE)


def noise(seed, count):
    return NOISE_C * np.random.default_rng(seed).standard_normal(count)


def after(test, innovations_c, doubt=Doubt()):  # noqa: B008 (a state that never changes)
    for read_c in innovations_c:
        doubt = test.by_reading(doubt, read_c)
    return doubt


def test_noise_hardly_ever_causes_doubt(test):
    doubts, state = [], Doubt()
    for read_c in noise(1, 20_000):
        state = test.by_reading(state, read_c)
        doubts.append(state.doubt)
    assert np.mean(np.array(doubts) > 0.1) < 0.005


@pytest.mark.parametrize("shift", [-5.0, 5.0])
def test_shift_of_five_deviations_is_certain_within_half_a_second(test, shift):
    assert after(test, noise(2, 10) + shift * NOISE_C).doubt == 1.0


def test_doubt_decays(test):
    begun = after(test, np.full(10, 5.0 * NOISE_C))
    later = after(test, np.zeros(round(HOLD_S / PERIOD_S)), begun)
    assert later.doubt == pytest.approx(begun.doubt / np.e, rel=0.2)


def test_doubt_ends_if_it_lasts(test):
    ticks = round(MOST_S / PERIOD_S)
    assert after(test, np.full(ticks - 5, 5.0 * NOISE_C)).doubt == 1.0
    assert after(test, np.full(ticks + 20, 5.0 * NOISE_C)).doubt == 0.0


def test_displacement_finds_a_disturbance_before_the_thermocouple(test):
    state = Doubt()
    for _ in range(10):
        state = test.by_both(state, 0.0, 20.0 * NOISE)
    assert state.doubt == 1.0
