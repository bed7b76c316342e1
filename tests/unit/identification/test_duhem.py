"""Identification of a Duhem model: its parameters and their standard errors."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.identification import identify_duhem
from smadrive.numerics.residuals import neighbour_correlation

WIRE = DuhemModel.gaussian(
    mu_heating=95, mu_cooling=75, sigma_heating=5, sigma_cooling=5.2, scale=-4.2, offset=5, input_range=(20, 140)
)
TURNS = [25, 135, 40, 120, 60, 100, 30, 135]
PATH = np.interp(np.arange(1401) / 200, np.arange(len(TURNS)), TURNS)
OUTPUT = WIRE.simulate(PATH)


def noisy(seed):
    return OUTPUT + 0.02 * np.random.default_rng(seed).standard_normal(len(OUTPUT))


def test_parameters_are_found():
    fit = identify_duhem(PATH, OUTPUT, components=1)
    assert fit.rms_percent < 0.01
    assert fit.model.heating.means[0] == pytest.approx(95, abs=0.05)
    assert fit.model.cooling.sigmas[0] == pytest.approx(5.2, abs=0.05)
    assert fit.model.scale == pytest.approx(-4.2, rel=1e-3)


@pytest.mark.exhaustive
def test_standard_errors_are_the_spread_of_repeated_records():
    fits = [identify_duhem(PATH, noisy(seed), components=1) for seed in range(12)]

    def numbers(of):
        return [
            of.heating.means[0],
            of.heating.sigmas[0],
            of.cooling.means[0],
            of.cooling.sigmas[0],
            of.scale,
            of.offset,
        ]

    spread = np.std([numbers(fit.model) for fit in fits], axis=0, ddof=1)
    told = np.mean([numbers(fit.standard_errors) for fit in fits], axis=0)
    assert (told < 2 * spread).all()
    assert (told > 0.5 * spread).all()
    assert fits[0].standard_errors.heating.weights == (0.0,)


@pytest.mark.exhaustive
def test_superfluous_components_have_large_standard_errors():
    """Two Gaussians are fitted to a record of one. Their weights have large standard errors."""
    errors = identify_duhem(PATH, noisy(0), components=2).standard_errors
    assert max(errors.heating.weights + errors.cooling.weights) > 0.1


def test_correlated_residuals_count_as_fewer_samples():
    slow, white = np.sin(np.arange(1000) / 50), np.random.default_rng(0).standard_normal(1000)
    assert neighbour_correlation(slow) > 0.99
    assert abs(neighbour_correlation(white)) < 0.1
