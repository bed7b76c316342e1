"""Check of a column's numbers against the unit in its name.

The fit cannot detect a wrong unit: a table in kelvin or metres gives as good a fit as a table in °C or mm, and a
certified model. A table states its units only in the names of its columns. So a wrong unit shows only by values that no
wire has in the unit of the column's name. Where the length of the wire is known, its stroke is compared with this
length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COLDEST_C = 250.0
"""A record of a wire in °C has temperatures well below this value; a record in kelvin is completely above it."""

SPANS_MM = (0.1, 1000.0)
"""Smallest and largest usual span of a displacement. Wires are a few mm to 20 m long, and move by a few percent."""

COLDEST_HEATED_C = 40.0
"""A column of temperatures whose values all stay below this value looks like displacements: a heated wire is warmer."""

FAR_MM = 10.0
"""A column of displacements whose values all exceed this value looks like temperatures: displacements begin near 0."""

STRAINS = (0.001, 0.1)
"""Smallest and largest usual stroke, as a share of the length of the wire.

A wire in use moves by 2 to 5 % of its length. Nickel-titanium recovers 8 % at most.
"""

SLOWEST_K_PER_S = 0.01
"""Smallest usual mean rate of the temperature in a record: 36 K per hour. Times in ms give a lower rate."""


def unit_caveats(name: str, values: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the caveats about the unit of the column `name`, one sentence each.

    Only names that end in `_c` or `_mm` are checked.
    """
    low, high = float(values.min()), float(values.max())
    if name.endswith("_c") and low > COLDEST_C:
        return (f"{name} ranges from {low:.6g} to {high:.6g}, which looks like kelvin: convert it to °C",)
    if name.endswith("_mm") and not SPANS_MM[0] <= high - low <= SPANS_MM[1]:
        meant = "metres" if high - low < SPANS_MM[0] else "micrometres"
        return (f"{name} moves by {high - low:.6g} in all, which looks like {meant}: convert it to mm",)
    return ()


def swap_caveats(names: tuple[str, str], v: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[str, ...]:
    """Return a caveat if the temperatures `v` and the displacements `y` look exchanged.

    `names` are the names of both columns. Only columns whose names end in `_c` and in `_mm` are checked.
    """
    is_swapped = float(v.max()) < COLDEST_HEATED_C and float(y.min()) > FAR_MM and np.ptp(y) > np.ptp(v)
    if not (names[0].endswith("_c") and names[1].endswith("_mm") and is_swapped):
        return ()
    ranges = f"{names[0]} ranges from {v.min():.4g} to {v.max():.4g}, {names[1]} from {y.min():.4g} to {y.max():.4g}"
    return (f"{ranges}: are the two columns exchanged?",)


def stroke_caveats(displacement_mm: NDArray[np.float64], length_mm: float) -> tuple[str, ...]:
    """Return the caveats about the unit of a displacement, one sentence each; none for a usual stroke.

    `displacement_mm` are the values of a record, `length_mm` is the length of the wire.
    """
    span_mm = float(np.ptp(displacement_mm))
    strain = span_mm / length_mm
    if STRAINS[0] <= strain <= STRAINS[1]:
        return ()
    low, high = (100 * limit for limit in STRAINS)
    moves = f"displacement_mm moves by {span_mm:.6g}, which is {100 * strain:.4g} % of length_mm = {length_mm:g}"
    cure = "check the unit and the scale of the sensor, a lever in front of it, and length_mm in the wire file"
    return (f"{moves}, and a wire moves by {low:g} to {high:g} %: {cure}",)


def time_caveats(times_s: NDArray[np.float64], name: str, values: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the caveats about the unit of `times_s`, which must be s, one sentence each.

    `values` are the column `name` of the same table. If this column is a temperature, its mean rate shows a wrong unit
    of the times. For any other column the result is empty.
    """
    duration_s = float(np.ptp(times_s))
    rate = float(np.abs(np.diff(values)).sum()) / duration_s if duration_s > 0 else np.inf
    if not name.endswith("_c") or rate >= SLOWEST_K_PER_S:
        return ()
    moves = f"time_s lasts {duration_s:.6g}, and {name} moves by {rate:.1g} K/s on average"
    return (f"{moves}: time_s looks like milliseconds: convert it to s",)
