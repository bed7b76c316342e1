"""The contribution of each cell to the state of a plane, and the fit of its masses."""

import numpy as np
import pytest

from smadrive.hysteresis import PreisachPlane
from smadrive.hysteresis.memory.plane import in_plane
from smadrive.hysteresis.memory.trajectory import plane_states
from smadrive.hysteresis.turning_points import Memory
from smadrive.identification.memory.incidence import PlaneGrid
from smadrive.identification.memory.plane_fit import PlaneProblem

from .conftest import nested_loops

UP, DOWN = np.linspace(70.0, 110.0, 9), np.linspace(48.0, 89.0, 8)
CELLS = in_plane(UP, DOWN)


@pytest.fixture
def plane(rng):
    mass = rng.random(CELLS.shape) * CELLS
    return PreisachPlane(UP, DOWN, mass / mass.sum())


def test_the_state_is_linear_in_the_masses(plane, rng):
    back_at_the_lower_end = [15.0, 60.0, 90.0, 70.0, 80.0, 15.0, 12.0, 85.0, 60.0, 80.0]
    v = np.concatenate([[20.0], rng.uniform(15.0, 135.0, 400), [90.0, 90.0, 60.0], back_at_the_lower_end])
    on = PlaneGrid(UP, DOWN, CELLS).shares_on(v, (15.0,))
    p = plane_states(plane, v, Memory(0.0, plane.everett(20.0, 15.0), (15.0,)))
    np.testing.assert_allclose(on @ plane.mass[CELLS], p, rtol=0, atol=1e-13)
    assert on.min() > -1e-12
    assert on.max() < 1 + 1e-12


def test_masses_are_recovered(plane, rng):
    v = nested_loops(rng)
    grid = PlaneGrid(UP, DOWN, CELLS)
    on = grid.shares_on(v, (20.0,))
    problem = PlaneProblem.of(on, np.ones(len(v)), grid, smoothness=1e-7)
    bottom, masses = problem.with_bottom(0.3 + 2.0 * on @ plane.mass[CELLS])
    assert bottom == pytest.approx(0.3, abs=1e-5)
    np.testing.assert_allclose(masses, 2.0 * plane.mass[CELLS], rtol=0, atol=1e-5)


def test_unseen_cells_get_the_density_of_their_neighbours(plane):
    grid = PlaneGrid(UP, DOWN, CELLS)
    v = np.concatenate([np.linspace(20.0, 110.0, 91), np.linspace(110.0, 48.0, 63)])
    on = grid.shares_on(v, (20.0,))
    masses = PlaneProblem.of(on, np.ones(len(v)), grid, smoothness=1e-3).masses(on @ plane.mass[CELLS])
    assert masses.sum() == pytest.approx(1.0, abs=1e-3)
    assert (masses > 0).mean() > 0.9
