"""Derivatives of the rules' least-squares problem, against differences of its residuals."""

from dataclasses import replace

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.record import prepare
from smadrive.identification.tsfuzzy.prior import Prior
from smadrive.identification.tsfuzzy.problem import RuleProblem
from smadrive.numerics.levenberg_marquardt import forward_differences

WIRE = DuhemModel.gaussian(
    mu_heating=95, mu_cooling=75, sigma_heating=9, sigma_cooling=9.5, scale=-4.2, offset=5, input_range=(20, 140)
)


@pytest.mark.parametrize("fit_centres", [True, False])
def test_every_block_of_the_jacobian_agrees_with_differences(fit_centres):
    """The rows are output errors (in more than one block), ties, and slopes of the wrong sign."""
    corners = [30, *(135, 35) * 6, 110, 40, 100, 70, 120, 30]
    v = np.interp(np.linspace(0, len(corners) - 1, 6000), np.arange(len(corners)), corners)
    record = prepare(v, WIRE.simulate(v), 0.0)
    prior = Prior(fit_duhem(record, 1), record)
    problem = replace(RuleProblem.near(record, prior, np.linspace(36, 128, 6), fit_centres), monotony=1.0, depth=1.0)
    x = problem.start.copy()
    x[:24] = x[:24] * np.random.default_rng(4).uniform(0.7, 1.3, 24) + 0.3  # no rule at the kink of a penalty
    x[6:18] += 3.0  # heating that falls near the upper branch
    x[-1] = 0.2
    blocks, expected = [*problem.jacobian(x)], forward_differences(problem.residuals, x)
    assert len(blocks) >= 4
    assert blocks[-1].any()
    off = np.abs(np.vstack(blocks) - expected)
    off[-len(blocks[-1]) :, 24:-3] = 0.0  # slopes are differenced at nodes of which some move with the centres
    assert (off.max(axis=0) <= 0.005 * np.abs(expected).max(axis=0)).all()  # ∂P and ∂Λ are straight between nodes
