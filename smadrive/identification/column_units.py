"""Check of a column's numbers against the unit in its name.

A table in kelvin or metres fits as well as one in °C or mm, and its model is certified. Only the names of columns give
units, so values that no wire has in that unit are the only sign of the mistake.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COLDEST_C = 250.0
"""Every record of a wire begins well below this value; in kelvin every record is above it."""

SPANS_MM = (0.1, 1000.0)
"""Wires move by a few percent of their length: these spans are those of wires of a few mm and of about 20 m."""


def unit_doubts(name: str, values: NDArray[np.float64]) -> tuple[str, ...]:
    """Reasons to doubt the unit of a column, one sentence each; empty for a name without a unit."""
    low, high = float(values.min()), float(values.max())
    if name.endswith("_c") and low > COLDEST_C:
        return (f"{name} goes from {low:.6g} to {high:.6g}, which looks like kelvin: convert it to °C",)
    if name.endswith("_mm") and not SPANS_MM[0] <= high - low <= SPANS_MM[1]:
        meant = "metres" if high - low < SPANS_MM[0] else "micrometres"
        return (f"{name} moves by {high - low:.3g} in all, which looks like {meant}: convert it to mm",)
    return ()
