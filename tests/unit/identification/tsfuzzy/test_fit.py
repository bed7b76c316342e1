"""Identification of rules: accuracy on loops outside the record, noise, gaps in the data, certificates."""

import numpy as np
import pytest
from marks import exhaustive

from smadrive.errors import DataError, IdentificationError
from smadrive.hysteresis import DuhemModel, InverseFeedforward
from smadrive.identification import identify_duhem, identify_tsfuzzy

PAPER = DuhemModel.table1()
WIRE = DuhemModel.gaussian(
    mu_heating=95, mu_cooling=75, sigma_heating=5, sigma_cooling=5.2, scale=-4.2, offset=5, input_range=(20, 140)
)


def path(rng, lower, upper, turns, samples):
    """A full sweep up, then random turning points, `samples` per stretch."""
    corners = [lower, upper, *rng.uniform(lower, upper, turns)]
    grid = np.arange(samples * (len(corners) - 1) + 1) / samples
    return np.interp(grid, np.arange(len(corners)), corners)


@pytest.fixture(scope="module")
def paper_record():
    v = path(np.random.default_rng(5), -300, 300, 100, 100)
    v = np.concatenate([v, np.linspace(v[-1], -300, 100)])
    return v, PAPER.simulate(v)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("fit_centres", "limit_percent"), [(False, 0.5), (True, 0.15)])
def test_fit_of_the_papers_model_predicts_other_loops(paper_record, fit_centres, limit_percent):
    fit = identify_tsfuzzy(*paper_record, fit_centres=fit_centres)
    assert len(fit.model.rules) == 22
    rng = np.random.default_rng(77)
    worst = 0.0
    for _ in range(100):
        v = path(rng, -300, 300, 10, 100)
        worst = max(worst, float(np.max(np.abs(fit.model.simulate(v) - PAPER.simulate(v)))))
    assert 100 * worst / PAPER.scale <= limit_percent
    assert fit.certificate.holds


@pytest.fixture(scope="module")
def noisy_record():
    rng = np.random.default_rng(1)
    v = path(rng, 25, 135, 21, 450)
    return v, WIRE.simulate(v), v + 0.2 * rng.standard_normal(len(v)), rng.standard_normal(len(v)) * 0.005 * 4.2


@pytest.fixture(scope="module")
def noisy_fit(noisy_record):
    _, y, noisy_v, noise = noisy_record
    return identify_tsfuzzy(noisy_v, y + noise)


@pytest.mark.exhaustive
def test_noise_on_both_columns(noisy_record, noisy_fit):
    v, y, _, _ = noisy_record
    error = noisy_fit.model.simulate(v, noisy_fit.y0) - y
    assert 100 * np.sqrt(np.mean(error**2)) / 4.2 <= 0.35
    assert noisy_fit.certificate.holds


def test_fit_of_a_noisy_record_can_be_inverted(noisy_fit):
    fit = noisy_fit
    assert fit.certificate.invertible_share >= 0.99
    inverted = InverseFeedforward(fit.model).trajectory(fit.predicted, fit.path[0], fit.y0)
    assert inverted.reachable.all()
    np.testing.assert_allclose(inverted.y, fit.predicted, rtol=0, atol=1e-8 * abs(fit.model.scale))


@pytest.mark.exhaustive
def test_fit_of_a_record_with_a_gap_is_certified(noisy_record):
    v, y, noisy_v, noise = noisy_record
    kept = ~((v > 85) & (v < 118))
    fit = identify_tsfuzzy(noisy_v[kept], (y + noise)[kept])
    assert fit.certificate.holds
    w = (fit.model.simulate(v) - fit.model.offset) / fit.model.scale
    assert w.min() >= -1e-9
    assert w.max() <= 1 + 1e-9


@pytest.mark.exhaustive
def test_branch_so_narrow_that_its_density_underflows_is_fitted():
    """Far from such a branch the local law is 0 = 0: it has no equilibrium there."""
    true = DuhemModel.gaussian(
        mu_heating=85.0, mu_cooling=60.0, sigma_heating=0.3, sigma_cooling=3.0, scale=1.0, input_range=(20.0, 84.9)
    )
    v = np.concatenate([np.linspace(22.0, 84.8, 300), np.linspace(84.8, 22.0, 300)])
    assert identify_tsfuzzy(v, true.simulate(v)).rms_percent < 5.0


@pytest.mark.exhaustive
def test_centres_can_be_given(noisy_record):
    v, y, _, _ = noisy_record
    centres = [40.0, 60.0, 70.0, 75.0, 80.0, 88.0, 92.0, 96.0, 101.0, 110.0, 130.0]
    fit = identify_tsfuzzy(v, y, sets=centres, fit_centres=False)
    np.testing.assert_allclose(fit.model.sets.centres, centres)
    assert fit.rms_percent < 1


def test_figures_describe_the_residual(noisy_record, noisy_fit):
    _, y, _, noise = noisy_record
    measured, fit = y + noise, noisy_fit
    np.testing.assert_allclose(fit.model.simulate(fit.path, fit.y0) - measured, fit.residual, atol=1e-9)
    assert fit.max_percent == pytest.approx(100 * np.abs(fit.residual).max() / np.ptp(measured))
    assert fit.rms_percent == pytest.approx(100 * np.sqrt(np.mean(fit.residual**2)) / np.ptp(measured))


def loop():
    v = np.concatenate([np.linspace(25, 135, 300), np.linspace(135, 25, 300)])
    return v, WIRE.simulate(v)


@pytest.mark.parametrize("identify", [identify_duhem, identify_tsfuzzy])
@pytest.mark.parametrize(
    ("spoil", "error", "where"),
    [
        (lambda v, y: (v[:-1], y), DataError, "input v and output y"),
        (lambda v, y: (np.where(np.arange(600) == 7, np.nan, v), y), DataError, "input v: index 7"),
        (lambda v, y: (v, np.where(np.arange(600) == 9, np.inf, y)), DataError, "output y: index 9"),
        (lambda v, y: (np.full(600, 50.0), y), IdentificationError, "input"),
        (lambda v, y: (v, np.full(600, 2.0)), IdentificationError, "output"),
        (lambda v, y: (v[:300], y[:300]), IdentificationError, "falling input"),
        exhaustive(lambda v, y: (v, np.random.default_rng(0).standard_normal(600)), IdentificationError, "output"),
        (lambda v, y: (np.column_stack([v, v]), y), DataError, "input v and output y"),
    ],
)
def test_record_that_determines_no_model_is_rejected(identify, spoil, error, where):
    with pytest.raises(error) as caught:
        identify(*spoil(*loop()))
    assert caught.value.where == where


def test_unusable_options_are_rejected():
    v, y = loop()
    with pytest.raises(IdentificationError) as error:
        identify_tsfuzzy(v, y, sets=[0.0, 50.0, 100.0])
    assert (error.value.where, error.value.limit) == ("sets", "25 to 135")
    with pytest.raises(IdentificationError) as error:
        identify_tsfuzzy(v, y, sets=1)
    assert (error.value.where, error.value.value) == ("sets", 1)
    with pytest.raises(IdentificationError) as error:
        identify_duhem(v, y, components=0)
    assert (error.value.where, error.value.value) == ("components", 0)
