"""Whether the numbers of a column can be in the unit that its name tells.

A table in kelvin or in metres fits as well as one in °C or mm, and its model is certified: only the names of columns
tell units, so a number that no wire has in such a unit is all that gives the mistake away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COLDEST_C = 250.0
"""Every record of a wire begins well below this; in kelvin every one is above."""

SPANS_MM = (0.1, 1000.0)
"""Wires move by some percent of their length: less is one of a few mm, more one of some 20 m."""


def unit_doubts(name: str, values: NDArray[np.float64]) -> tuple[str, ...]:
    """What lets doubt the unit of a column with `name`, in sentences; nothing of a name that tells no unit."""
    low, high = float(values.min()), float(values.max())
    if name.endswith("_c") and low > COLDEST_C:
        return (f"{name} goes from {low:.6g} to {high:.6g}, which looks like kelvin: convert it to °C",)
    if name.endswith("_mm") and not SPANS_MM[0] <= high - low <= SPANS_MM[1]:
        meant = "metres" if high - low < SPANS_MM[0] else "micrometres"
        return (f"{name} moves by {high - low:.3g} in all, which looks like {meant}: convert it to mm",)
    return ()
