"""The noise of a thermocouple in its readings, compared with the `noise_c` of the rig file.

The third difference of the readings removes the motion of the wire. White noise of the standard deviation σ gives it
the standard deviation sqrt(1 + 9 + 9 + 1) σ. The median of its absolute values is robust against spikes and reversals.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import MEDIAN_SHARE

LEAST_SAMPLES = 100
"""The noise of fewer samples is unknown."""

TOO_NOISY = 2.0
"""A noise above this multiple of `noise_c` is a caveat: without a sensor, the controller then reverses at the noise."""


def noise_caveats(reading_c: FloatArray, given_c: float) -> tuple[str, ...]:
    """Return a caveat if the reading has much more noise than the `noise_c` of the rig file, K, otherwise nothing."""
    noise_c = measured_noise_c(reading_c)
    if not noise_c > TOO_NOISY * given_c:
        return ()
    what = f"the noise of the thermocouple is {noise_c:.2g} K, and noise_c in the rig file is {given_c:g} K"
    return (f"{what}: set noise_c = {noise_c:.2g} in [feedback], or shield the thermocouple",)


def measured_noise_c(reading_c: FloatArray) -> float:
    """Return the standard deviation of the noise of a reading, K; NaN for too few samples.

    A value that is repeated, because the thermometer is slower than the loop, counts once.
    """
    finite_c = reading_c[np.isfinite(reading_c)]
    new_c = finite_c[np.flatnonzero(np.diff(finite_c, prepend=np.nan) != 0.0)]
    if new_c.size < LEAST_SAMPLES:
        return np.nan
    return float(np.median(np.abs(np.diff(new_c, n=3)))) / MEDIAN_SHARE / sqrt(20.0)
