"""The dead band removes false reversals and keeps true ones, in real time and over a record."""

import numpy as np
import pytest

from smadrive.errors import ModelError
from smadrive.hysteresis import DeadBand, filter_reversals
from smadrive.hysteresis.reversal import Play, monotone_runs, turning_points

TRUTH = np.concatenate([np.linspace(20, 100, 800), np.linspace(100, 50, 500), np.linspace(50, 120, 700)])
NOISY = TRUTH + 0.2 * np.random.default_rng(1).standard_normal(len(TRUTH))


def reversals(path):
    signs = np.sign(np.diff(path))
    signs = signs[signs != 0]
    return int((signs[1:] != signs[:-1]).sum())


def test_noise_makes_no_reversals():
    assert reversals(NOISY) > 500
    assert reversals(filter_reversals(NOISY, 1.0)) == 2
    assert reversals(monotone_runs(NOISY, 1.0)) == 2
    assert len(turning_points(NOISY, 1.0)) == 4


def test_filtered_input_does_not_lag():
    assert np.mean((filter_reversals(NOISY, 1.0) - TRUTH)[100:700]) == pytest.approx(0, abs=0.2)
    assert np.mean((monotone_runs(NOISY, 1.0) - TRUTH)[100:700]) == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize("samples", [500, 2000])
def test_turning_point_is_not_the_extreme_of_its_noise(samples):
    corners = [20.0, 100.0, 50.0, 120.0, 80.0, 85.0, 30.0, 60.0]
    truth = np.interp(np.arange(7 * samples + 1) / samples, np.arange(len(corners)), corners)
    outward = []
    for seed in range(8):
        noisy = truth + 0.2 * np.random.default_rng(seed).standard_normal(len(truth))
        turns = turning_points(noisy, 1.0)[1:-1]
        outward.append([1, -1, 1, -1, 1, -1] * (monotone_runs(noisy, 1.0)[turns] - corners[1:-1]))
    assert np.mean(outward) == pytest.approx(0, abs=0.04)  # 0.20 and more for the extremes
    assert np.sqrt(np.mean(np.square(outward))) < 0.15


def test_real_time_filter_equals_the_filter_of_a_record():
    band = DeadBand(1.0)
    np.testing.assert_array_equal([band.update(v) for v in NOISY], filter_reversals(NOISY, 1.0))


def test_small_reversals_leave_the_output_constant():
    np.testing.assert_allclose(filter_reversals([0, 5, 4, 4.5, 6, 3.5, 4, 3], 1.0), [0, 5, 5, 5, 6, 3.5, 3.5, 3])


def test_radius_of_zero_changes_nothing():
    np.testing.assert_array_equal(filter_reversals(NOISY, 0.0), NOISY)
    np.testing.assert_allclose(monotone_runs(NOISY, 0.0), NOISY, atol=1e-12)


@pytest.mark.parametrize("turn", [70.0, 50.0])
def test_resized_dead_band_keeps_its_output_and_passes_what_its_new_radius_passes(turn):
    play = Play(60.0).moved(turn, 1.0)
    resized = play.resized(1.0, 0.2)
    assert resized.output(0.2) == play.output(1.0) == turn
    back = turn + (0.3 if turn < 60.0 else -0.3)
    assert play.moved(back, 1.0).output(1.0) == turn
    assert resized.moved(back, 0.2).output(0.2) == pytest.approx(turn)
    further = turn + (0.5 if turn < 60.0 else -0.5)
    assert resized.moved(further, 0.2).output(0.2) == pytest.approx(further)


def test_constant_input_stays_constant():
    np.testing.assert_array_equal(monotone_runs(np.full(5, 3.0), 0.5), np.full(5, 3.0))


def test_radius_must_not_be_negative():
    with pytest.raises(ModelError) as error:
        DeadBand(-1.0)
    assert error.value.value == -1
