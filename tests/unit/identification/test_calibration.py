"""Offset and scale of a sensor from points, with the uncertainty that repeated calibrations really have."""

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.identification.calibration import CalibrationPoint, fit_calibration


def points(values, scale=0.98, offset=1.5, deviation=0.01, noise=0.0):
    """Points of a sensor whose readings are corrected by `scale` and `offset`."""
    return [
        CalibrationPoint(value, (value - offset) / scale + error, 0.0, deviation)
        for value, error in zip(values, np.broadcast_to(noise, len(values)), strict=True)
    ]


def test_line_through_two_points_is_exact():
    fit = fit_calibration(points([0.0, 100.0]))
    assert (fit.offset, fit.scale) == pytest.approx((1.5, 0.98))
    assert fit.residual == pytest.approx(0.0, abs=1e-9)


def test_one_point_gives_the_offset_alone():
    fit = fit_calibration([CalibrationPoint(0.0, 0.8, 0.03, 0.04)])
    assert (fit.offset, fit.scale) == (-0.8, 1.0)
    assert fit.offset_uncertainty == pytest.approx(2 * 0.05)
    assert fit.scale_uncertainty is None


def test_uncertainty_covers_the_truth_in_95_percent_of_all_calibrations():
    random = np.random.default_rng(1)
    fits = [
        fit_calibration(points([0.0, 40.0, 100.0], deviation=0.1, noise=random.normal(0.0, 0.1, 3)))
        for _ in range(2000)
    ]
    for name, truth in (("offset", 1.5), ("scale", 0.98)):
        covered = [abs(getattr(fit, name) - truth) <= getattr(fit, f"{name}_uncertainty") for fit in fits]
        assert 0.94 < np.mean(covered) < 0.99


def test_points_off_the_line_enlarge_the_uncertainty():
    straight = fit_calibration(points([0.0, 50.0, 100.0]))
    bent = fit_calibration(points([0.0, 50.0, 100.0], noise=[0.0, 1.0, 0.0]))
    assert bent.scale_uncertainty > 10 * straight.scale_uncertainty
    assert bent.residual > 0.3


@pytest.mark.parametrize("given", [[], points([20.0, 20.1]), points([0.0, 100.0], noise=[0.0, -100.0 / 0.98])])
def test_points_that_determine_no_line_are_refused(given):
    with pytest.raises(DataError) as error:
        fit_calibration(given)
    assert error.value.cure
