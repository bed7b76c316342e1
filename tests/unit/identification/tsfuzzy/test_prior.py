"""The prior of the rules has the local laws of the Duhem fit."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.record import prepare
from smadrive.identification.tsfuzzy.prior import Prior
from smadrive.identification.tsfuzzy.sensitivity import laws_of

OVERLAPPING = DuhemModel.gaussian(
    mu_heating=85, mu_cooling=75, sigma_heating=12, sigma_cooling=12, scale=4.2, offset=0, input_range=(20, 140)
)
"""A narrow loop with wide branches: each law has its equilibrium well inside (0, 1) where it acts."""


@pytest.mark.parametrize("rising", [True, False])
def test_prior_has_the_local_laws_of_the_duhem_fit(rising):
    v = np.interp(np.linspace(0, 6, 3000), np.arange(7), [22, 138, 22, 100, 60, 110, 22])
    record = prepare(v, OVERLAPPING.simulate(v), 0.0)
    prior = Prior(fit_duhem(record, 1), record)
    a, b = laws_of(*prior.rates)[0 if rising else 1]
    span = np.ptp(record.input_range)
    expected_a, expected_b = prior.model.local_laws(prior.grid, rising=rising)
    assert np.abs(expected_a).max() * span < 200.0  # no rate is clipped
    np.testing.assert_allclose(a, expected_a * span, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(b, expected_b * span, rtol=1e-9, atol=1e-12)
