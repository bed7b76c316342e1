"""A Duhem model and a Preisach plane in parallel: the division of the output between the two parts.

    y = bottom + θ x(v; μ₊, μ₋, σ₊, σ₋) + Σ_cells on_cell m_cell             θ ≥ 0, m ≥ 0

y is the output, v the input, and bottom the output at x = 0 with all relays off. x is the state of a Duhem model with
one Gaussian per branch: mean μ₊ and standard deviation σ₊ on heating, μ₋ and σ₋ on cooling. θ is the weight of the
Duhem part. m_cell is the mass of a cell of the plane, and on_cell the share of its relays that are on.

Only the parameters of the Duhem part enter nonlinearly. For each trial of these parameters, the masses follow from
non-negative least squares. So the search has six unknowns (variable projection). The derivatives assume that masses
that are zero stay zero.

A plane with negative masses could imitate almost every Duhem model on a record. A plane without negative masses cannot,
so the record determines θ.
"""

from __future__ import annotations

import numpy as np
import scipy

from smadrive.hysteresis import GaussianMixture
from smadrive.hysteresis.branch.engine import BranchEngine
from smadrive.hysteresis.duhem import duhem_branches, grid_logs
from smadrive.identification.memory.plane_fit import PlaneProblem
from smadrive.numerics.arrays import FloatArray

_CELLS = 192  # of the table of a trial model
_STEEPEST = 1e3  # rate of a trial model per input span, where its branches touch
_TRIALS = 30
_STEP = 1e-4
_START = 0.5  # θ, as a share of the output span
_LEAST_GAP, _NARROWEST, _WIDEST = 0.02, 0.003, 0.3  # of the input span


class _Search:
    """Residuals and their derivatives with respect to x = (bottom, θ, μ₊, μ₊ - μ₋, ln σ₊, ln σ₋).

    Inputs are measured in spans from the lower end of the range.
    """

    def __init__(self, problem: PlaneProblem, v: FloatArray, y: FloatArray, input_range: tuple[float, float]) -> None:
        self._problem, self._y = problem, y
        self._v = (v - input_range[0]) / (input_range[1] - input_range[0])
        self._nodes = np.linspace(0.0, 1.0, _CELLS + 1)
        self._latest = np.empty(0), np.empty(0)

    def duhem(self, x: FloatArray) -> FloatArray:
        """Return the output of the Duhem part, the bottom included."""
        means, sigmas = (x[2], x[2] - x[3]), np.exp(x[4:])
        heating, cooling = (
            grid_logs(GaussianMixture((1.0,), (float(mu),), (float(sigma),)), self._nodes)
            for mu, sigma in zip(means, sigmas, strict=True)
        )
        engine = BranchEngine(self._nodes, _CELLS, *duhem_branches(heating, cooling, self._nodes, _STEEPEST))
        start = engine.target(float(self._v[0]), rising=bool(self._v[0] < 0.5))
        return np.asarray(x[0] + x[1] * engine.trajectory(self._v, start))

    def masses(self, x: FloatArray) -> FloatArray:
        if not np.array_equal(self._latest[0], x):
            self._latest = x.copy(), self._problem.masses(self._y - self.duhem(x))
        return self._latest[1]

    def residuals(self, x: FloatArray) -> FloatArray:
        return self._problem.residuals(self._y - self.duhem(x), self.masses(x))

    def jacobian(self, x: FloatArray) -> FloatArray:
        active = self.masses(x) > 0
        now = self.duhem(x)
        changes = []
        for number in range(len(x)):
            moved = x.copy()
            moved[number] += _STEP
            changes.append((self.duhem(moved) - now) / _STEP)
        return -self._problem.unexplained(np.column_stack(changes), active)


def duhem_part(
    problem: PlaneProblem, v: FloatArray, y: FloatArray, input_range: tuple[float, float], start: FloatArray
) -> FloatArray:
    """Fit both parts to the outputs `y` on the path `v`, and return the output of the Duhem part with the bottom.

    The result, `y` and `v` have the shape (samples,). The result and `y` are in output spans. `problem` is the fit of
    the plane for the same path. The search starts at `start` (4,): the means of the heating and the cooling branch,
    then their standard deviations, from a Duhem fit, in the unit of v.
    """
    search = _Search(problem, v, y, input_range)
    lower, span = input_range[0], input_range[1] - input_range[0]
    heating, cooling = (start[:2] - lower) / span
    sigmas = np.log(np.clip(start[2:] / span, 1.1 * _NARROWEST, 0.9 * _WIDEST))
    low = np.array([-np.inf, 0.0, -1.0, _LEAST_GAP, np.log(_NARROWEST), np.log(_NARROWEST)])
    high = np.array([np.inf, 2.0, 2.0, 1.0, np.log(_WIDEST), np.log(_WIDEST)])
    guess = np.array([float(y.min()), _START, heating, max(heating - cooling, 1.1 * _LEAST_GAP), *sigmas])
    best = scipy.optimize.least_squares(
        search.residuals,
        guess,
        search.jacobian,
        bounds=(low, high),
        x_scale=[0.1, 0.1, 0.02, 0.02, 0.2, 0.2],
        max_nfev=_TRIALS,
        xtol=1e-5,
        ftol=1e-5,
    )
    return search.duhem(best.x)
