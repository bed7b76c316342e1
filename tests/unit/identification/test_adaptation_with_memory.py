"""Online adaptation of a model with memory: rules and plane follow a wire that drifts, and stay certified."""

from functools import cache
from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smadrive.errors import ModelError
from smadrive.hysteresis import DuhemModel, PreisachPlane, TriangularSets, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.hysteresis.memory.plane import in_plane
from smadrive.identification.adaptation.adaptation import Adaptation
from smadrive.identification.adaptation.plane_state import UNMOVED, PlaneState
from smadrive.identification.reshape import moved_plane, reshaped, shape_of

RANGE, STROKE_MM = (0.0, 200.0), 12.0
NOISE_C, NOISE_MM = 0.02, 0.012
TIMES_S = np.arange(0.0, 1200.0, 0.25)
UP, DOWN = np.linspace(72.0, 108.0, 25), np.linspace(50.0, 88.0, 24)


@cache
def plane():
    middles = (UP[1:] + UP[:-1]) / 2, (DOWN[1:] + DOWN[:-1]) / 2
    heating, cooling = ((middle - mu) / 5.0 for middle, mu in zip(middles, (89.9, 69.0), strict=True))
    mass = np.exp(-0.5 * (heating[:, None] ** 2 + cooling[None, :] ** 2)) * in_plane(UP, DOWN)
    return PreisachPlane(UP, DOWN, mass / mass.sum())


@cache
def model(share):
    duhem = DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=STROKE_MM, input_range=RANGE
    )
    sets = TriangularSets((30.0, 55.0, 62.0, 66.0, 70.0, 74.0, 79.0, 84.0, 88.0, 92.0, 96.0, 101.0, 110.0))
    return TSFuzzyPreisach(TSFuzzyDuhem.from_duhem(duhem, sets), plane(), share)


def drifted(share, shift_c, drift):
    """The model of a wire whose branches have shifted and whose stroke has changed."""
    given_model = model(share)
    shape = shape_of(given_model)
    moved = {"mu_heating": shape.mu_heating + shift_c, "mu_cooling": shape.mu_cooling + shift_c}
    return reshaped(given_model, shape._replace(**moved, scale=shape.scale * (1.0 + drift)))


def rms(errors):
    return float(np.sqrt(np.mean(np.square(errors))))


def follow(share, shift_c, drift):
    """Return the RMS errors of the fixed and of the adapted model, in percent of the stroke, in the last quarter."""
    rng, fixed_model = np.random.default_rng(1), model(share)
    path_c = 80.0 + (16.0 + 6.0 * np.sin(TIMES_S / 53.0)) * np.sin(2 * np.pi * TIMES_S / 56.0 - 1.5)
    true = drifted(share, shift_c, drift).simulate(path_c)
    fixed, adaptation, errors = fixed_model.simulate(path_c), Adaptation(fixed_model, 0.1), []
    for number, (v, y) in enumerate(zip(path_c.tolist(), true.tolist(), strict=True)):
        adaptation.update(v + NOISE_C * rng.normal(), y + NOISE_MM * rng.normal())
        errors.append(adaptation.predicted_mm - y)
        if number % 400 == 0:
            assert adaptation.model.certificate().holds
    last = slice(3 * len(TIMES_S) // 4, None)
    assert adaptation.sensor_fault is None
    return 100.0 * rms((fixed - true)[last]) / STROKE_MM, 100.0 * rms(errors[last]) / STROKE_MM, adaptation


@pytest.mark.exhaustive
@pytest.mark.parametrize("share", [0.3, 0.7, 1.0])
def test_drift_is_followed_with_a_third_of_the_error(share):
    fixed, adapted, adaptation = follow(share, 3.0, -0.05)
    assert fixed > 5.0
    assert adapted < fixed / 3.0
    shape = shape_of(adaptation.model)
    assert abs(shape.mu_heating - shape_of(drifted(share, 3.0, 0.0)).mu_heating) < 1.0


@pytest.mark.exhaustive
def test_constant_wire_keeps_its_model():
    assert follow(0.5, 0.0, 0.0)[1] < 0.5


turning_points = st.lists(st.floats(*RANGE), min_size=1, max_size=12)
moves = st.tuples(st.floats(-8, 8), st.floats(-0.2, 0.2), st.floats(-8, 8), st.floats(-0.2, 0.2)).map(np.array)


@given(turning_points)
def test_state_of_an_unmoved_plane_is_that_of_the_model(path):
    whole = model(1.0)
    state, hysteresis = PlaneState(whole), whole.initial_state(RANGE[0])
    for v in path:
        state.move(v)
        hysteresis = whole.step(hysteresis, v)
    assert state.state(UNMOVED)[0] == pytest.approx(hysteresis.w, abs=1e-9)


@given(turning_points, moves)
def test_derivatives_of_the_state_agree_with_differences(path, theta):
    state, step = PlaneState(model(1.0)), 1e-7
    for v in path:
        state.move(v)
    p, slopes = state.state(theta)
    for number in range(4):
        ways = [theta + way * step * np.eye(4)[number] for way in (-1, 1)]
        below, above = (state.state(way)[0] for way in ways)
        left, right = (p - below) / step, (above - p) / step  # they differ where a threshold is hit
        assert min(left, right) - 1e-5 < slopes[number] < max(left, right) + 1e-5


@given(moves)
def test_moved_plane_is_valid_for_every_move(theta):
    whole = model(1.0)
    moved = PlaneState(whole).plane(theta)
    assert moved.mass.sum() == pytest.approx(1.0)
    TSFuzzyPreisach(whole.local, moved, 1.0)


def test_thresholds_that_cross_keep_their_mass_in_the_next_cell():
    up, down, mass = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 2.0]), np.array([[0.2, 0.0], [0.0, 0.8]])
    with pytest.raises(ModelError):
        PreisachPlane(up - 0.5, down, mass)
    moved = moved_plane(up - 0.5, down, mass, (-10.0, 10.0))
    np.testing.assert_allclose(moved.mass, [[0.0, 0.0], [1.0, 0.0]])


def test_thresholds_beyond_the_range_move_to_its_end():
    moved = moved_plane(UP + 100.0 * exp(1.0), DOWN, plane().mass, RANGE)
    assert moved.up_thresholds[-1] == RANGE[1]
    assert np.all(np.diff(moved.up_thresholds) > 0)
