"""The axis of the tracking error follows the errors in the shown window of time.

The axis always contains zero, and is never shorter than `LEAST_PERCENT`, so that noise alone does not fill the plot.
The axis grows at once, but shrinks only when it is much too long (see SHRINKS), so that it seldom changes.
"""

from __future__ import annotations

from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

LEAST_PERCENT = 2.0
"""Shortest span of the axis, in percent of the stroke. The noise of a displacement sensor spans about 0.6 %."""

MARGIN = 0.05
"""Margin at either end of the axis, as a share of the span of the errors."""

SHRINKS = 1.6
"""The axis shrinks when it is more than this many times as long as the shown errors need."""

STEPS = 10
"""The ends of the axis are multiples of a round step. This step is at least the length of the axis / `STEPS`."""

Ends = tuple[float, float]


def error_axis(errors: NDArray[np.float64], present: Ends) -> Ends:
    """Return the low and the high end of the axis, in percent, for the shown `errors`, in percent.

    `present` are the present ends of the axis. Errors that are not finite are left out.
    """
    finite = errors[np.isfinite(errors)]
    low, high = min(0.0, float(finite.min(initial=0.0))), max(0.0, float(finite.max(initial=0.0)))
    new = _rounded(*_widened(low, high))
    fits = present[0] <= low and high <= present[1]
    is_short = present[1] - present[0] <= SHRINKS * (new[1] - new[0])
    return present if fits and is_short else new


def _widened(low: float, high: float) -> Ends:
    """Return the ends with their margins, at least `LEAST_PERCENT` apart."""
    margin = MARGIN * (high - low)
    missing = max(LEAST_PERCENT - (high - low + 2.0 * margin), 0.0)
    return low - margin - 0.5 * missing, high + margin + 0.5 * missing


def _rounded(low: float, high: float) -> Ends:
    """Return the ends rounded outwards to multiples of 1, 2 or 5 times a power of ten."""
    exact = (high - low) / STEPS
    power = 10.0 ** floor(log10(exact))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= exact * (1.0 - 1e-9))
    return round(floor(low / step + 1e-9) * step, 9), round(ceil(high / step - 1e-9) * step, 9)
