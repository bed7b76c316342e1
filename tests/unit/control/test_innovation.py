"""The innovation test: noise, disturbances, and the lag of the thermocouple."""

import numpy as np
import pytest

from smadrive.control.estimation.innovation import HOLD_S, LASTING_NOISES, MOST_S, DisturbanceEvidence, InnovationTest

PERIOD_S, NOISE_C, NOISE = 0.05, 0.1, 0.001


@pytest.fixture
def test():
    return InnovationTest(PERIOD_S, NOISE_C, NOISE)


def noise(seed, count):
    return NOISE_C * np.random.default_rng(seed).standard_normal(count)


def after(test, innovations_c, evidence=DisturbanceEvidence()):  # noqa: B008 (a state that never changes)
    for read_c in innovations_c:
        evidence = test.by_reading(evidence, read_c, 0.0)
    return evidence


def test_noise_is_hardly_ever_evidence(test):
    levels, state = [], DisturbanceEvidence()
    for read_c in noise(1, 20_000):
        state = test.by_reading(state, read_c, 0.0)
        levels.append(state.level)
    assert np.mean(np.array(levels) > 0.1) < 0.005


@pytest.mark.parametrize("shift", [-5.0, 5.0])
def test_shift_of_five_deviations_is_certain_within_half_a_second(test, shift):
    assert after(test, noise(2, 10) + shift * NOISE_C).level == 1.0


def test_evidence_decays(test):
    begun = after(test, np.full(10, 5.0 * NOISE_C))
    later = after(test, np.zeros(round(HOLD_S / PERIOD_S)), begun)
    assert later.level == pytest.approx(begun.level / np.e, rel=0.2)


def test_evidence_ends_if_it_lasts(test):
    ticks = round(MOST_S / PERIOD_S)
    assert after(test, np.full(ticks - 5, 5.0 * NOISE_C)).level == 1.0
    assert after(test, np.full(ticks + 20, 5.0 * NOISE_C)).level == 0.0


def after_displacements(test, errors, state=None, noises=LASTING_NOISES, **options):
    """Return the state after displacements with these errors; their noise is `noises` times the least one."""
    state = state or DisturbanceEvidence()
    for error in errors:
        state = test.by_both(state, 0.0, 0.0, noises * error, noises, **options)
    return state


LONG = round(10.0 * MOST_S / PERIOD_S)


def test_evidence_of_a_displacement_that_keeps_its_sign_lasts(test):
    lasts = after_displacements(test, np.full(LONG, 5.0 * NOISE))
    assert (lasts.level, lasts.lasting) == (0.0, 1.0)
    assert after_displacements(test, np.zeros(round(5.0 * HOLD_S / PERIOD_S)), lasts).lasting < 0.01


def test_precise_displacement_of_every_tick_gives_no_lasting_evidence(test):
    """The gains in calm air find a load with it, and larger ones would follow an error of the temperature."""
    assert after_displacements(test, np.full(LONG, 5.0 * NOISE), noises=1.0).lasting == 0.0


def test_rare_displacement_gives_lasting_evidence_even_if_it_is_precise(test):
    state = DisturbanceEvidence()
    for n in range(LONG):
        state = test.by_both(state, 0.0, 0.0, 5.0 * NOISE, is_new=n % 4 == 0)
    assert test.by_both(state, 0.0, 0.0, 5.0 * NOISE).lasting == pytest.approx(0.5)


@pytest.mark.parametrize("more", [2.5, 10.0, 50.0])
def test_more_noise_than_assumed_is_no_lasting_evidence(test, more):
    errors = more * NOISE * np.random.default_rng(1).standard_normal(LONG)
    lasting = [after_displacements(test, errors[:end]).lasting for end in range(LONG // 2, LONG, 10)]
    assert np.mean(lasting) < 0.25


def test_spikes_are_no_lasting_evidence(test):
    errors = np.where(np.arange(LONG) % 10 == 0, 100.0 * NOISE, 0.0)
    assert after_displacements(test, errors).lasting == 0.0


def test_evidence_of_a_held_displacement_ends_if_it_lasts(test):
    held = after_displacements(test, np.full(LONG, 20.0 * NOISE), is_new=False)
    assert held.lasting == held.level == 0.0
    assert test.by_both(held, 0.0, 0.0, 20.0 * NOISE).lasting == 1.0


def test_displacement_finds_a_disturbance_before_the_thermocouple(test):
    state = DisturbanceEvidence()
    for _ in range(10):
        state = test.by_both(state, 0.0, 0.0, 20.0 * NOISE)
    assert state.level == 1.0


def test_error_of_the_lag_in_a_fast_heating_is_no_disturbance(test):
    calm = fast = DisturbanceEvidence()
    for _ in range(10):
        calm, fast = test.by_reading(calm, 1.0, 0.0), test.by_reading(fast, 1.0, 15.0)
    assert calm.level == 1.0
    assert fast.level == 0.0
