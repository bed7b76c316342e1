"""The noise of a thermocouple in its readings, compared with the noise that the controller assumed.

The third difference of the readings removes the motion of the wire. The median of its absolute values is robust against
spikes and reversals.
"""

from __future__ import annotations

import numpy as np

from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import noise_deviation

LEAST_SAMPLES = 100
"""The noise of fewer samples is unknown."""

TOO_NOISY = 2.0
"""A noise above this multiple of the assumed one is a caveat: without a sensor, the controller reverses at noise."""


def noise_caveats(reading_c: FloatArray, assumed_c: float) -> tuple[str, ...]:
    """Return a caveat if the reading has much more noise than `assumed_c`, K, otherwise nothing."""
    noise_c = measured_noise_c(reading_c)
    if not noise_c > TOO_NOISY * assumed_c:
        return ()
    what = f"the noise of the thermocouple is {noise_c:.2g} K, and the controller assumes {assumed_c:.2g} K"
    return (f"{what}: set noise_c = {noise_c:.2g} in [feedback], or shield the thermocouple",)


def measured_noise_c(reading_c: FloatArray) -> float:
    """Return the standard deviation of the noise of a reading, K; NaN for too few different samples."""
    finite_c = reading_c[np.isfinite(reading_c)]
    if np.count_nonzero(np.diff(finite_c)) < LEAST_SAMPLES - 1:
        return np.nan
    return noise_deviation(finite_c, order=3)
