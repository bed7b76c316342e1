"""The loop of a wire in one run: shifts and stroke are found, with honest errors, and a draft is none."""

from itertools import pairwise

import numpy as np
import pytest
from marks import exhaustive

from smadrive.hysteresis import DuhemModel
from smadrive.identification.loop_drift import UNKNOWN, fit_loop_drift, wire_temperature_c

NOISE_C, NOISE_MM = 0.1, 0.012
DT_S = 0.05


def wire(heating_k=0.0, cooling_k=0.0, stroke=1.0, scale=12.0):
    return DuhemModel.gaussian(
        mu_heating=90 + heating_k,
        mu_cooling=69 + cooling_k,
        sigma_heating=5,
        sigma_cooling=5,
        scale=scale * stroke,
        input_range=(0, 200),
    )


def samples(true, turns_c, seed=1):
    """Times, wire temperatures, readings of a thermocouple without lag, and displacements along ramps of 3 K/s."""
    random = np.random.default_rng(seed)
    ramps = [np.arange(a, b, np.sign(b - a) * 3.0 * DT_S) for a, b in pairwise(turns_c)]
    wire_c = np.concatenate(ramps)
    reading_c = wire_c + NOISE_C * random.standard_normal(len(wire_c))
    moved_mm = true.simulate(wire_c) + NOISE_MM * random.standard_normal(len(wire_c))
    return DT_S * np.arange(len(wire_c)), wire_c, reading_c, moved_mm


WHOLE_C = (25, 120, 25, 120, 25)


@pytest.mark.parametrize("scale", [12.0, exhaustive(-3.0)])
@pytest.mark.parametrize("change", [exhaustive((0, 0, 1)), (2, 2, 0.97), exhaustive((-1, 1.5, 1.03))])
def test_moved_loop_is_found(change, scale):
    time_s, _, reading_c, moved_mm = samples(wire(*change, scale=scale), WHOLE_C)
    found = fit_loop_drift(wire(scale=scale), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C)
    heating_k, cooling_k, stroke = change
    assert found.heating_k == pytest.approx(heating_k, abs=0.1)
    assert found.cooling_k == pytest.approx(cooling_k, abs=0.1)
    assert 1.0 + found.stroke_share == pytest.approx(stroke, abs=0.003)
    assert (found.model_percent < 0.5) == (change == (0, 0, 1))


def test_loop_that_moved_by_twice_the_width_of_its_branches_is_found_in_a_part_of_the_travel():
    time_s, _, reading_c, moved_mm = samples(wire(10.0, 10.0), (25, 101, 74, 101, 74))
    found = fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C)
    assert found.heating_k == pytest.approx(10.0, abs=0.2)
    assert found.cooling_k == pytest.approx(10.0, abs=0.2)
    assert found.stroke_share == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("stuck_from", [0.0, exhaustive(0.4)])
def test_stuck_sensor_shows_no_loop(stuck_from):
    time_s, _, reading_c, moved_mm = samples(wire(), (25, 101, 74, 101, 74))
    stuck_mm = np.where(time_s < stuck_from * time_s[-1], moved_mm, moved_mm[0])
    found = fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), stuck_mm, NOISE_C)
    assert np.isnan([found.heating_k, found.cooling_k, found.stroke_share]).all()
    assert found.model_percent > 10.0


@pytest.mark.exhaustive
def test_standard_errors_are_honest():
    """The errors of many runs of the same wire scatter as their standard errors say."""
    off = []
    for seed in range(8):
        time_s, _, reading_c, moved_mm = samples(wire(1.0, 0.5, 0.98), (25, 100, 60, 95, 25), seed)
        found = fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C)
        off.append(np.array([found.heating_k - 1.0, found.cooling_k - 0.5, found.stroke_share + 0.02]) / found.errors)
    assert np.all(np.sqrt(np.mean(np.square(off), axis=0)) < 2.0)


@pytest.mark.exhaustive
def test_unvisited_part_of_the_loop_has_a_large_error():
    """Below the middle of the heating branch, a shift and a change of the stroke look alike."""
    time_s, _, reading_c, moved_mm = samples(wire(), (25, 84, 25))
    part = fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C)
    time_s, _, reading_c, moved_mm = samples(wire(), WHOLE_C)
    whole = fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C)
    assert part.errors[2] > 2.0 * whole.errors[2]


@pytest.mark.parametrize("seed", [0, *map(exhaustive, (1, 2))])
def test_small_reversals_of_a_held_wire_are_no_drift(seed):
    """A wire that is held at 85 °C while its temperature dips by 0.4 K transforms a little further in each dip."""
    _, wire_c, _, _ = samples(wire(), (25, 85, 87, 74, *(89.5, 68) * 6, 25))
    held = int(np.argmax(wire_c >= 85.0))
    dips_c = 85.0 - 0.2 * (1.0 - np.cos(np.linspace(0.0, 6.0 * np.pi, 400)))
    wire_c = np.concatenate([wire_c[:held], dips_c, wire_c[held:]])
    random = np.random.default_rng(seed)
    reading_c = wire_c + NOISE_C * random.standard_normal(len(wire_c))
    moved_mm = wire().simulate(wire_c) + NOISE_MM * random.standard_normal(len(wire_c))
    smooth_c = wire_temperature_c(DT_S * np.arange(len(wire_c)), reading_c, 0.0)
    found = fit_loop_drift(wire(), smooth_c, moved_mm, NOISE_C)
    assert np.all(np.abs([found.heating_k, found.cooling_k, found.stroke_share]) < 3.0 * np.array(found.errors))


def test_resting_wire_does_not_show_its_loop():
    time_s, _, reading_c, moved_mm = samples(wire(), (25, 40, 25))
    assert fit_loop_drift(wire(), wire_temperature_c(time_s, reading_c, 0.0), moved_mm, NOISE_C) == UNKNOWN


def lagged(wire_c, lag_s):
    """The reading of a thermocouple with a lag."""
    reading_c = [wire_c[0]]
    for at_c in wire_c[1:].tolist():
        reading_c.append(reading_c[-1] + (at_c - reading_c[-1]) * (1.0 - np.exp(-DT_S / lag_s)))
    return np.array(reading_c)


def test_loop_that_no_model_has_leaves_only_the_error_known():
    """A bead has become loose and slow: the wire seems to move on heating at colder readings than on cooling."""
    narrow = wire(heating_k=-18.0)
    _, wire_c, _, moved_mm = samples(narrow, WHOLE_C)
    found = fit_loop_drift(narrow, lagged(wire_c, 1.0), moved_mm, NOISE_C)
    assert np.isnan([found.heating_k, found.cooling_k, found.stroke_share, *found.errors]).all()
    assert found.model_percent > 5.0


def test_lag_of_the_thermocouple_is_removed():
    time_s, wire_c, _, _ = samples(wire(), WHOLE_C)
    lag_s = 0.25
    reading_c = lagged(wire_c, lag_s)
    error_c = wire_temperature_c(time_s, reading_c, lag_s) - wire_c
    is_between_turns = np.abs(np.gradient(np.gradient(wire_c))) < 1e-9
    assert np.abs(error_c[is_between_turns][20:-20]).max() < 0.3
    assert np.abs(reading_c - wire_c).max() > 0.6
