"""A piecewise linear function, looked up one point at a time.

A control loop looks up single values several times a tick. `numpy.interp` gives exactly the same values, but takes five
times as long for a single value.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from math import nan


class PiecewiseLinear:
    """A piecewise linear function of one variable, given by its corners.

    `places` are the arguments of the corners, ascending. Below the first corner and above the last corner the function
    is constant.
    """

    def __init__(self, places: Iterable[float], values: Iterable[float]) -> None:
        self._places = list(map(float, places))
        self._values = list(map(float, values))

    def at(self, place: float) -> float:
        """Return the value of the function at the argument `place`; NaN for NaN."""
        places, values = self._places, self._values
        if not places[0] < place < places[-1]:
            return values[0] if place <= places[0] else values[-1] if place >= places[-1] else nan
        before = bisect_right(places, place) - 1
        slope = (values[before + 1] - values[before]) / (places[before + 1] - places[before])
        return slope * (place - places[before]) + values[before]
