"""Where a record has no samples, the branches of the rules continue in the right direction over the whole range."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smadrive.hysteresis import DuhemModel
from smadrive.identification import identify_tsfuzzy

WIRE = DuhemModel.gaussian(
    mu_heating=88, mu_cooling=70, sigma_heating=5, sigma_cooling=5.2, scale=11.2, offset=0, input_range=(20, 125)
)


def excitation(start, low, high):
    """Return the path of an experiment: two major loops, then shrinking loops. `start` is the first temperature."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inner = [middle + sign * half * share for share in (0.8, 0.5, 0.3) for sign in (1, -1)]
    corners = np.array([start, high, low, high, low, *inner, low, high, low])
    steps = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    return np.interp(np.arange(0.0, steps[-1], 0.7), steps, corners)


def measured(v, y):
    rng = np.random.default_rng(2)
    return v + 0.02 * rng.standard_normal(len(v)), y + 0.01 * rng.standard_normal(len(v))


def branches(model):
    """Return the output along a sweep over the whole range and back, from the cold end of the loop."""
    lower, upper = model.input_range
    sweep = np.linspace(lower, upper, 400)
    y = model.simulate(np.concatenate([sweep, sweep[::-1]]))
    return y[:400], y[400:]


def flat_where_it_turns(path):
    """A Preisach wire: relays between pairs of temperatures. After a reversal inside the loop it first stands still."""
    spread = 12 * np.linspace(-1, 1, 25)
    heats, cools = np.meshgrid(88 + spread, 70 + spread)
    weight = np.exp(-(((heats - 88) / 6) ** 2) - ((cools - 70) / 6) ** 2) * (heats > cools)
    on = np.zeros_like(weight, dtype=bool)
    y = []
    for v in path:
        on = (on | (v >= heats)) & (v > cools)
        y.append(11.2 * float(weight[on].sum() / weight.sum()))
    return np.array(y)


@pytest.mark.exhaustive
@pytest.mark.parametrize("wire", [WIRE.simulate, flat_where_it_turns], ids=["duhem", "preisach"])
def test_wire_returns_to_its_start_below_the_coldest_turning_point(wire):
    """The experiment begins 18 K below its lowest turning point, so it has no samples on cooling below this point."""
    v = excitation(22.0, 40.0, 120.0)
    y = wire(v)
    fit = identify_tsfuzzy(*measured(v, y))
    heating, cooling = branches(fit.model)
    assert np.diff(heating).min() >= -1e-6
    assert np.diff(cooling).max() <= 1e-6
    assert heating[-1] - heating[0] == pytest.approx(11.2, rel=0.03)
    assert cooling[-1] == pytest.approx(0.0, abs=0.03 * 11.2)
    assert fit.rms_percent < 1.5


@pytest.mark.exhaustive
@settings(max_examples=8, deadline=None)
@given(st.floats(20.0, 60.0), st.floats(40.0, 95.0), st.floats(5.0, 33.0), st.sampled_from([True, False]))
def test_branches_are_monotone_whatever_is_missing(low, start, width, rising):
    """No branch reverses, neither below the lowest turning point nor in a gap of one direction."""
    v = excitation(20.0, low, 122.0)
    moves = np.diff(v, prepend=v[0])
    kept = ~((v > start) & (v < start + width) & ((moves > 0) == rising))
    fit = identify_tsfuzzy(*measured(v[kept], WIRE.simulate(v)[kept]), sets=7)
    heating, cooling = branches(fit.model)
    assert np.diff(heating).min() >= -1e-6
    assert np.diff(cooling).max() <= 1e-6
    assert fit.certificate.holds
    assert fit.certificate.turned_share < 1e-6
    known = np.sort([WIRE.offset, WIRE.offset + WIRE.scale])
    states = np.sort([fit.model.offset, fit.model.offset + fit.model.scale])
    assert (np.abs(states - known) <= 0.15 * abs(WIRE.scale)).all()
