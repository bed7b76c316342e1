"""Properties of a hysteresis model for any input: rate independence, local memory, bounds, contraction, inverse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smadrive.hysteresis import DuhemModel, InverseFeedforward, TriangularSets, TSFuzzyDuhem

from .conftest import MODELS, PAPER, WIRE

LOWER, UPPER = 0.0, 100.0
shares = st.floats(0.0, 1.0)
paths = st.lists(shares, min_size=2, max_size=12)
any_model = st.sampled_from(list(MODELS.values()))
any_duhem = st.sampled_from([PAPER, WIRE])


@st.composite
def contracting_models(draw):
    """T-S models with random centres and rules that contract and are bounded."""
    gaps = np.array(draw(st.lists(st.floats(2.0, 30.0), min_size=4, max_size=9)))
    centres = LOWER + (UPPER - LOWER) * np.cumsum(gaps)[:-1] / gaps.sum()
    rates = st.lists(st.floats(1e-3, 0.5), min_size=len(centres), max_size=len(centres))
    equilibria = st.lists(st.floats(0.0, 1.0), min_size=len(centres), max_size=len(centres))
    a_up, a_down = -np.array(draw(rates)), np.array(draw(rates))
    b_up, b_down = -a_up * np.array(draw(equilibria)), -a_down * np.array(draw(equilibria))
    return TSFuzzyDuhem(
        TriangularSets(tuple(centres)),
        a_heating=a_up,
        b_heating=b_up,
        a_cooling=a_down,
        b_cooling=b_down,
        input_range=(LOWER, UPPER),
    )


def spread(model, path):
    lower, upper = model.input_range
    return lower + (upper - lower) * np.array(path)


@given(any_model, paths, st.integers(2, 9))
def test_rate_independence(model, path, repeats):
    turns = spread(model, path)
    slow = np.interp(np.arange(repeats * (len(turns) - 1) + 1) / repeats, np.arange(len(turns)), turns)
    np.testing.assert_allclose(
        model.simulate(slow)[::repeats], model.simulate(turns), rtol=0, atol=1e-12 * abs(model.scale)
    )


@given(any_model, paths, paths)
def test_local_memory(model, before, after):
    """The future depends only on the present (v, y), not on the earlier path."""
    v = spread(model, [*before, *after])
    y = model.simulate(v)
    start = len(before) - 1
    np.testing.assert_allclose(model.simulate(v[start:], y[start]), y[start:], rtol=0, atol=1e-10 * abs(model.scale))


@given(any_duhem, paths)
def test_branches_are_monotone_and_contained(model, path):
    v = spread(model, path)
    w = (model.simulate(v) - model.offset) / model.scale
    assert (np.diff(w) * np.sign(np.diff(v)) >= -1e-9).all()
    for v_now, w_now in zip(v.tolist(), w.tolist(), strict=True):
        low, high = model.admissible(v_now)
        assert low - 1e-9 <= w_now <= high + 1e-9


@settings(max_examples=40, deadline=None)
@given(contracting_models(), paths, shares, shares)
def test_certified_contraction_and_bounds(model, path, first, second):
    v = spread(model, path)
    certificate = model.certificate()
    assert certificate.contracting
    assert certificate.bounded
    one, other = model.simulate(v, first), model.simulate(v, second)
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(v)))])
    assert (np.abs(one - other) <= abs(first - second) * np.exp(-certificate.contraction_rate * travel) + 1e-9).all()
    assert min(one.min(), other.min()) >= -1e-9
    assert max(one.max(), other.max()) <= 1 + 1e-9


@given(any_duhem, paths, st.lists(st.floats(-0.1, 1.1), min_size=1, max_size=8))
def test_reachable_setpoint_is_reached(model, path, wanted):
    state = model.initial_state(spread(model, path)[0])
    for v in spread(model, path):
        state = model.step(state, v)
    inverse = InverseFeedforward(model)
    for w in wanted:
        y_wanted = model.offset + model.scale * w
        inversion = inverse.update(state, y_wanted)
        state = model.step(state, inversion.v)
        assert state.y == pytest.approx(inversion.y, abs=1e-9 * abs(model.scale))
        if inversion.reachable:
            assert state.y == pytest.approx(y_wanted, abs=2e-9 * abs(model.scale))
        else:
            assert inversion.v in (model.engine.lower, model.engine.upper)


@given(paths)
def test_inverse_of_inverse(path):
    v = 40 + 80 * np.array(path)
    wanted = WIRE.simulate(v)
    result = InverseFeedforward(WIRE).trajectory(wanted, v[0])
    reached = WIRE.simulate(result.v, wanted[0])
    np.testing.assert_allclose(reached, wanted, rtol=0, atol=1e-8 * abs(WIRE.scale))


def test_periodic_input_has_one_attracting_loop():
    loop = np.tile([70.0, 97.0], 40)
    ends = [WIRE.simulate(loop, y0)[-2:] for y0 in (WIRE.offset, WIRE.offset + WIRE.scale)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    assert isinstance(WIRE, DuhemModel)
