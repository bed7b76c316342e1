"""Metrics of series of samples. A sample that was not measured is NaN, and is left out."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any

import numpy as np

from smadrive.numerics.arrays import FloatArray

MEASURABLE = 0.05
"""A resistance is computed only at currents of at least this share of current_max_a, where offsets matter little."""


def rms_and_max(values: FloatArray) -> tuple[float, float]:
    """Return the RMS and the largest magnitude of the finite values. Both are NaN when no value is finite."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else nan, of_finite(np.max, np.abs(finite))


def of_finite(function: Callable[[FloatArray], Any], values: FloatArray) -> float:
    """Return `function` of the finite values, or NaN when no value is finite."""
    finite = values[np.isfinite(values)]
    return float(function(finite)) if finite.size else nan


def energy_j(time_s: FloatArray, current_a: FloatArray, voltage_v: FloatArray) -> float:
    """Return the electrical energy in J: the sum of V I dt, with the power at the end of each interval."""
    power_w = current_a * voltage_v
    return float(np.nansum(power_w[1:] * np.diff(time_s)))
