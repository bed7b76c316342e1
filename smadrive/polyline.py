"""A piecewise linear function of time, looked up one moment at a time.

In a control loop that is done several times a tick, on plain floats: numpy's interpolation gives the same to the last
bit, and takes five times as long for a single value.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable


class Polyline:
    """Straight between the corners (`times_s`, which increase, and `values`); before and behind them the ends hold."""

    def __init__(self, times_s: Iterable[float], values: Iterable[float]) -> None:
        self._times_s = list(map(float, times_s))
        self._values = list(map(float, values))

    def at(self, time_s: float) -> float:
        """The value at `time_s`."""
        times_s, values = self._times_s, self._values
        if not times_s[0] < time_s < times_s[-1]:
            return values[0] if time_s <= times_s[0] else values[-1]
        before = bisect_right(times_s, time_s) - 1
        slope = (values[before + 1] - values[before]) / (times_s[before + 1] - times_s[before])
        return slope * (time_s - times_s[before]) + values[before]
