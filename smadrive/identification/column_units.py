"""Check of a column's numbers against the unit in its name.

A table in kelvin or metres gives as good a fit as a table in °C or mm, and a certified model. Only the names of the
columns contain units. So the only sign of a wrong unit are values that no wire has in the unit of the name.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COLDEST_C = 250.0
"""A record of a wire in °C has temperatures well below this value; a record in kelvin is completely above it."""

SPANS_MM = (0.1, 1000.0)
"""Smallest and largest usual span of a displacement. Wires move by a few percent of their length, a few mm to 20 m."""


def unit_doubts(name: str, values: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the reasons to doubt the unit of the column `name`, one sentence each.

    Only names that end in `_c` or `_mm` are checked.
    """
    low, high = float(values.min()), float(values.max())
    if name.endswith("_c") and low > COLDEST_C:
        return (f"{name} ranges from {low:.6g} to {high:.6g}, which looks like kelvin: convert it to °C",)
    if name.endswith("_mm") and not SPANS_MM[0] <= high - low <= SPANS_MM[1]:
        meant = "metres" if high - low < SPANS_MM[0] else "micrometres"
        return (f"{name} has a span of {high - low:.3g}, which looks like {meant}: convert it to mm",)
    return ()
