"""The value of a quantity at given times, from the held readings of a sensor that is slower than these times.

Each sample holds the latest reading, so during a motion its value lags by the age of this reading. A loop of a wire
from such samples is too wide: at 6 K/s, a laser that is read at 5 Hz moves a fitted branch by 3 K.
"""

from __future__ import annotations

import numpy as np

from smadrive.numerics.arrays import FloatArray

SAME_S = 1e-6
"""Readings whose times differ by less are one reading, s."""


def between_readings(time_s: FloatArray, age_s: FloatArray, latest: FloatArray) -> FloatArray:
    """Return the values at `time_s`, interpolated between the readings, in the unit of `latest`.

    `latest` are the latest readings and `age_s` their ages, all (samples,). The result is NaN where `latest` is not
    finite. After the last reading it is constant.
    """
    read_s = time_s - age_s
    valid = np.isfinite(latest) & np.isfinite(read_s)
    new = np.flatnonzero(valid)[np.diff(read_s[valid], prepend=-np.inf) > SAME_S]
    if not new.size:
        return np.full_like(latest, np.nan)
    return np.where(valid, np.interp(time_s, read_s[new], latest[new]), np.nan)
