"""The branch engine agrees with an ODE solver, and its result does not depend on the step size or form of a step."""

import itertools

import numpy as np
import pytest
from marks import exhaustive
from scipy.integrate import solve_ivp

from smadrive.hysteresis import DuhemModel

from .conftest import MODELS

SHORT = {"paper", "triangular"}
"""The models whose comparison with the ODE solver is short: one of each class."""


def law(model, v, *, rising):
    """Return a and b at v from the definition, without the table."""
    if isinstance(model, DuhemModel):
        return model.local_laws(np.array(v), rising=rising)
    a, b = model.heating_law if rising else model.cooling_law
    weights = model.sets.weights(np.array(v))
    return weights @ a, weights @ b


def solve(model, turns, w):
    """Return the states at the turning points by DOP853, restarted at every kink of the law."""
    kinks = np.empty(0) if isinstance(model, DuhemModel) else model.sets.kinks
    states = [w]
    for start, end in itertools.pairwise(turns):
        between = np.sort(kinks[(kinks > min(start, end)) & (kinks < max(start, end))])
        stops = [start, *(between if end > start else between[::-1]), end]
        for v0, v1 in itertools.pairwise(stops):

            def slope(v, w, rising=end > start):
                a, b = law(model, v, rising=rising)
                return a * w + b

            width = abs(v1 - v0) / 8
            w = solve_ivp(slope, (v0, v1), [w], method="DOP853", rtol=1e-12, atol=1e-14, max_step=width).y[0, -1]
        states.append(w)
    return np.array(states)


@pytest.mark.parametrize("model", [name if name in SHORT else exhaustive(name) for name in MODELS], indirect=True)
def test_agrees_with_dop853(model, turns):
    start = model.initial_state(turns[0])
    expected = model.offset + model.scale * solve(model, turns, start.w)
    np.testing.assert_allclose(model.simulate(turns), expected, rtol=0, atol=1e-9 * abs(model.scale))


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(6))
def test_random_gaussian_models_agree_with_dop853(seed):
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(3, 30)
    model = DuhemModel.gaussian(
        mu_heating=rng.uniform(0.5, 2) * sigma,
        mu_cooling=-rng.uniform(0.5, 2) * sigma,
        sigma_heating=sigma,
        sigma_cooling=sigma * rng.uniform(0.96, 1.04),
        input_range=(-6 * sigma, 6 * sigma),
    )
    turns = np.concatenate([[-6 * sigma], rng.uniform(-5 * sigma, 5 * sigma, 12)])
    expected = solve(model, turns, model.initial_state(turns[0]).w)
    np.testing.assert_allclose(model.simulate(turns), expected, rtol=0, atol=1e-9)


def test_sampling_does_not_matter(model, turns):
    ends = [model.simulate(sampled(turns, n))[::n] for n in (10, 10_000)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12 * abs(model.scale))


def test_stepping_agrees_with_simulation(model, turns):
    path = sampled(turns, 20)
    state, outputs = model.initial_state(path[0]), []
    for v in path.tolist():
        state = model.step(state, v)
        outputs.append(state.y)
    np.testing.assert_allclose(outputs, model.simulate(path), rtol=0, atol=1e-12 * abs(model.scale))


def test_slope_is_the_derivative(model, turns):
    state = model.initial_state(turns[0])
    for v in turns[1:].tolist():
        state = model.step(state, v)
        for direction in (1, -1):
            moved = model.step(state, v + direction * 1e-4).y - state.y
            assert model.slope(state, direction) == pytest.approx(direction * moved / 1e-4, abs=1e-5 * abs(model.scale))


def test_batch_of_wires_equals_single_simulations(model, turns):
    paths = np.column_stack([turns, turns[::-1], 0.5 * (turns + turns[0])])
    together = model.simulate(paths)
    for wire in range(3):
        np.testing.assert_array_equal(together[:, wire], model.simulate(paths[:, wire]))


def test_state_is_constant_outside_the_range(model):
    lower, upper = model.input_range
    y = model.simulate([lower, 1e6, upper, -1e300, lower])
    assert np.isfinite(y).all()
    assert y[1] == y[2]
    assert y[3] == y[4]


def test_wide_range_keeps_its_tails():
    model = DuhemModel.gaussian(mu_heating=95, mu_cooling=75, sigma_heating=5, sigma_cooling=5, input_range=(-1e6, 1e6))
    y = model.simulate(np.concatenate([np.linspace(-1e6, 1e6, 10_001), np.linspace(1e6, -1e6, 10_001)]))
    assert np.isfinite(y).all()
    assert y.min() >= 0
    assert y.max() <= 1


def sampled(turns, n):
    """The path through the turning points with n samples per stretch."""
    share = np.arange(n) / n
    stretches = [start + (end - start) * share for start, end in itertools.pairwise(turns)]
    return np.concatenate([*stretches, turns[-1:]])


def test_models_have_compact_tables():
    assert all(len(model.engine.nodes) < 20_000 for model in MODELS.values())
