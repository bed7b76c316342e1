"""The Preisach plane: its differences from a Duhem model, and the properties of every hysteresis of a wire."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from firmware_sim.config import Transformation
from firmware_sim.physics.preisach import CELL_K, Preisach
from firmware_sim.physics.transformation import Duhem

BRANCHES = {
    "mu_heating_c": 90.0,
    "mu_cooling_c": 69.0,
    "sigma_heating_c": 5.0,
    "sigma_cooling_c": 4.0,
    "range_c": (0.0, 200.0),
}
PLANE = Preisach(Transformation(kind="preisach", correlation=0.6, **BRANCHES))
PATHS = st.lists(st.floats(20.0, 140.0), min_size=1, max_size=12)


def walk(model, path, start_v=22.0, steps=1):
    """Return the phases at the turning points of `path`."""
    state, v, phases = model.start(start_v), start_v, []
    for target in path:
        for v1 in np.linspace(v, target, steps + 1)[1:].tolist():
            state = model.moved(state, v, v1)
            v = v1
        phases.append(model.phase(state))
    return phases


def test_major_loop_follows_the_gaussians():
    up, down = np.arange(70.0, 110.0, 1.0), np.arange(110.0, 50.0, -1.0)
    phases = walk(PLANE, [*up, *down])
    assert phases[: len(up)] == pytest.approx(ndtr((up - 90.0) / 5.0), abs=3e-3)
    assert phases[len(up) :] == pytest.approx(ndtr((down - 69.0) / 4.0), abs=3e-3)


@settings(deadline=None)
@given(PATHS)
def test_phase_is_between_0_and_1_and_follows_the_input(path):
    phases, v, before = walk(PLANE, path), 22.0, 0.0
    for target, phase in zip(path, phases, strict=True):
        assert -1e-12 <= phase <= 1.0 + 1e-12
        assert (phase - before) * (target - v) >= -1e-12
        v, before = target, phase


@settings(deadline=None)
@given(PATHS)
def test_small_steps_end_like_one_large_step(path):
    assert walk(PLANE, path, steps=7) == pytest.approx(walk(PLANE, path), abs=1e-9)


@settings(deadline=None)
@given(PATHS, st.floats(40.0, 90.0), st.floats(60.0, 120.0))
def test_minor_loop_closes_and_is_wiped_out(path, inner_low, inner_high):
    """When the wire is back at its highest point, it continues as without the minor loop."""
    top = 125.0 if inner_high > 100.0 else 100.0
    outer = [*path, 10.0, top, 75.0]
    excursion = [min(inner_high, top), max(inner_low, 75.0), top]
    plain, detour = walk(PLANE, [*outer, top, 60.0, 95.0]), walk(PLANE, [*outer, *excursion, 60.0, 95.0])
    assert detour[-3:] == pytest.approx(plain[-3:], abs=1e-9)


def test_minor_loops_are_congruent():
    early = walk(PLANE, [95.0, 70.0, 85.0, 70.0])
    late = walk(PLANE, [130.0, 70.0, 85.0, 70.0])
    assert early[-2] - early[-1] == pytest.approx(late[-2] - late[-1], abs=1e-9)
    assert abs(early[-1] - late[-1]) > 0.02


def test_duhem_model_of_the_same_branches_behaves_differently():
    """A Duhem model cannot reproduce the plane. Otherwise the driver would be tested on its own equations."""
    duhem = Duhem(Transformation(**BRANCHES))
    path = [92.0, 72.0, 92.0]
    before, after = (walk(PLANE, path)[i] for i in (0, 2))
    assert after == pytest.approx(before, abs=1e-9)
    before, after = (walk(duhem, path)[i] for i in (0, 2))
    assert after > before + 0.02
    differences = [abs(a - b) for a, b in zip(walk(PLANE, path), walk(duhem, path), strict=True)]
    assert max(differences) > 0.03


@settings(deadline=None)
@given(PATHS, st.floats(30.0, 130.0))
def test_slope_agrees_with_finite_differences(path, v):
    assume(min(v / CELL_K % 1.0, -v / CELL_K % 1.0) > 1e-3)  # the slope jumps where two cells of the plane meet
    state = PLANE.start(22.0)
    for before, after in zip([22.0, *path], [*path, v], strict=True):
        state = PLANE.moved(state, before, after)
    for rising, step in ((True, 1e-4), (False, -1e-4)):
        moved = PLANE.moved(state, v, v + step)
        secant = (PLANE.phase(moved) - PLANE.phase(state)) / step
        assert PLANE.slope(state, v, rising=rising) == pytest.approx(secant, abs=2e-3)
