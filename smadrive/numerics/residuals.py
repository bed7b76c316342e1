"""The noise of a record, and the correlation of the residuals of a fit.

Residuals whose neighbours are alike hold less information than their number says. If ρ is the correlation of each
residual with the next one, and it decays geometrically, n residuals are worth n (1 - ρ) / (1 + ρ) independent ones.
"""

from __future__ import annotations

import numpy as np

from smadrive.numerics.arrays import FloatArray

MEDIAN_SHARE = 0.6745
"""Median of the absolute values of Gaussian numbers, in standard deviations."""

MOST_ALIKE = 0.99
"""A larger correlation of neighbours counts as this one."""


def neighbour_correlation(residual: FloatArray) -> float:
    """Return the correlation of each residual with the next residual; 0 if all residuals are zero."""
    power = float(residual @ residual)
    return float(residual[1:] @ residual[:-1]) / power if power > 0 else 0.0


def samples_per_independent(residual: FloatArray) -> float:
    """Return the number of residuals that are worth one independent residual: (1 + ρ) / (1 - ρ), at least 1."""
    alike = min(max(neighbour_correlation(residual), 0.0), MOST_ALIKE)
    return (1.0 + alike) / (1.0 - alike)


def noise_deviation(samples: FloatArray) -> float:
    """Return the standard deviation of white noise on a smooth record, from the median absolute second difference."""
    if len(samples) < 5:
        return 0.0
    return float(np.median(np.abs(np.diff(samples, 2))) / MEDIAN_SHARE / np.sqrt(6.0))
