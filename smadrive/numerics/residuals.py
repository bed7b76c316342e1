"""The noise of a record, and the correlation of the residuals of a fit.

Residuals whose neighbours are alike hold less information than their number says. If ρ is the correlation of each
residual with the next one, and it decays geometrically, n residuals are worth n (1 - ρ) / (1 + ρ) independent ones.
"""

from __future__ import annotations

from math import comb, sqrt

import numpy as np

from smadrive.numerics.arrays import FloatArray

MEDIAN_SHARE = 0.6745
"""Median of the absolute values of Gaussian numbers, in standard deviations."""

MOST_ALIKE = 0.99
"""A larger correlation of neighbours counts as this one."""

REPEATED = 1.0 / 3.0
"""If more than this share of the samples repeat the previous one, the sensor is slower than the record, or coarse."""

WHOLE = 0.01
"""A step is a multiple of the quantum if it differs from the multiple by less than this share of the quantum."""

FINEST = 1e-6
"""A quantum is at least this share of the largest step: a smaller one is that of the floating-point numbers."""


def neighbour_correlation(residual: FloatArray) -> float:
    """Return the correlation of each residual with the next residual; 0 if all residuals are zero."""
    power = float(residual @ residual)
    return float(residual[1:] @ residual[:-1]) / power if power > 0 else 0.0


def samples_per_independent(residual: FloatArray) -> float:
    """Return the number of residuals that are worth one independent residual: (1 + ρ) / (1 - ρ), at least 1."""
    alike = min(max(neighbour_correlation(residual), 0.0), MOST_ALIKE)
    return (1.0 + alike) / (1.0 - alike)


def noise_deviation(samples: FloatArray, order: int = 2) -> float:
    """Return the standard deviation of white noise on a smooth record, from the median absolute difference of `order`.

    A higher order removes more of the motion. If many samples repeat the previous one, because their sensor is slower
    than the record or coarse, a repeated value counts once, and the result is at least the deviation of the rounding.
    It is 0 for fewer than five samples.
    """
    if len(samples) < 5:
        return 0.0
    moves = np.diff(samples) != 0.0
    rounding = 0.0
    if np.count_nonzero(~moves) > REPEATED * len(moves):
        samples = samples[np.flatnonzero(np.append(True, moves))]
        rounding = quantum(samples) / sqrt(12.0)
    if len(samples) < 5:
        return rounding
    differences = np.abs(np.diff(samples, order))
    return max(float(np.median(differences)) / MEDIAN_SHARE / sqrt(comb(2 * order, order)), rounding)


def quantum(samples: FloatArray) -> float:
    """Return the number of which every step between neighbouring samples is a multiple; 0 if there is none."""
    steps = np.abs(np.diff(samples))
    least = float(steps.min(initial=np.inf))
    if not least > FINEST * float(steps.max(initial=0.0)):
        return 0.0
    multiples = steps / least
    is_whole = np.abs(multiples - np.round(multiples)) < WHOLE
    return least if steps.size and np.all(is_whole) else 0.0
