"""Offset and scale of a sensor from readings at known values: value = scale * reading + offset.

With one point the scale stays 1. With several points, the straight line is fitted by least squares. Each point is
weighted by the inverse of its variance: the variance of the value plus the variance of the reading, because the scale
is near 1 (Guide to the Expression of Uncertainty in Measurement, 5.1). If the residuals are larger than these variances
explain, the uncertainty is multiplied by the Birge ratio, the square root of χ² / (n - 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from smadrive.errors import DataError

COVERAGE = 2.0
"""Expanded uncertainties are this many standard uncertainties (95 % of a normal distribution)."""

APART = 20.0
"""The points must span this many standard uncertainties, or they do not determine a scale."""


class CalibrationPoint(NamedTuple):
    """A known value, the mean reading of the sensor at this value, and the standard uncertainties of both."""

    value: float
    reading: float
    value_uncertainty: float
    reading_uncertainty: float

    @property
    def variance(self) -> float:
        """The variance of the difference between value and reading."""
        return self.value_uncertainty**2 + self.reading_uncertainty**2


@dataclass(frozen=True)
class CalibrationFit:
    """Offset and scale with expanded uncertainties (k = 2), and the largest residual.

    With one point the scale is 1 and `scale_uncertainty` is None.
    """

    offset: float
    offset_uncertainty: float
    scale: float
    scale_uncertainty: float | None
    residual: float


def fit_calibration(points: Sequence[CalibrationPoint]) -> CalibrationFit:
    """Return offset and scale of the sensor. DataError without a point, or when the points are too close together."""
    if not points:
        raise DataError("a calibration needs at least one point", cure="give the value of a point")
    if len(points) == 1:
        point = points[0]
        return CalibrationFit(point.value - point.reading, COVERAGE * sqrt(point.variance), 1.0, None, 0.0)
    _check_apart(points)
    values, readings = (np.array([getattr(point, name) for point in points]) for name in ("value", "reading"))
    deviation = np.sqrt([point.variance for point in points])
    design = np.column_stack([np.ones_like(readings), readings]) / deviation[:, None]
    (offset, scale), *_ = np.linalg.lstsq(design, values / deviation)
    residuals = values - scale * readings - offset
    freedom = len(points) - 2
    ratio = sqrt(max(1.0, float(np.sum((residuals / deviation) ** 2)) / freedom)) if freedom else 1.0
    spread = COVERAGE * ratio * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    return CalibrationFit(float(offset), float(spread[0]), float(scale), float(spread[1]), float(abs(residuals).max()))


def check_values_apart(values: Sequence[float], uncertainty: float) -> None:
    """Raise DataError when several known values are too close together to determine a scale."""
    if len(values) > 1:
        _check_span("value", values, uncertainty)


def _check_apart(points: Sequence[CalibrationPoint]) -> None:
    """Raise DataError when values or readings are too close together to determine a scale."""
    deviation = sqrt(max(point.variance for point in points))
    for name in ("value", "reading"):
        _check_span(name, [getattr(point, name) for point in points], deviation)


def _check_span(name: str, numbers: Sequence[float], deviation: float) -> None:
    span = max(numbers) - min(numbers)
    if span < APART * deviation:
        raise DataError(
            f"the {name}s of the points are too close together to determine a scale",
            value=f"{span:.3g} apart",
            limit=f"{APART * deviation:.3g}",
            cure="choose values farther apart, check that the sensor follows them, or calibrate at one point only",
        )
