"""Two ways to wait before a condition counts: until several samples show it, or until it has lasted for some time.

A sensor that is slower than the loop shows the same reading in several ticks. `Renewal` tells which readings are new.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from smadrive.measurement import Measurement

RENEWED_S = 1e-6
"""A reading that is newer than the last one by more than this is a new one, s: ages have rounding errors."""


@dataclass(slots=True)
class Debounce:
    """Debounces one condition. The condition counts when at least `needed` of the last `window` samples showed it."""

    needed: int
    window: int
    _recent: deque[bool] = field(init=False)

    def __post_init__(self) -> None:
        """Start without samples."""
        self._recent = deque(maxlen=self.window)

    def update(self, bad: bool | None) -> bool:
        """Add one sample; `bad` is True if it shows the condition. Return True if the condition counts.

        `bad` is None if there is no new sample. The result then stands still.
        """
        if not (bad or self._recent):
            return False
        if bad is not None:
            self._recent.append(bad)
        count = sum(self._recent)
        if not count:
            self._recent.clear()
        return count >= self.needed


class Renewed(NamedTuple):
    """Which readings of a measurement are new."""

    temperature: bool
    displacement: bool


class Renewal:
    """Tells which readings of each measurement are new."""

    def __init__(self) -> None:
        self._temperature_s = self._displacement_s = -inf

    def update(self, measurement: Measurement) -> Renewed:
        """Return which readings are newer than those of the measurement before. A reading of unknown age is new."""
        temperature_s = measurement.time_s - measurement.temperature_age_s
        displacement_s = measurement.time_s - measurement.displacement_age_s
        renewed = Renewed(
            measurement.temperature_age_s == 0.0 or not temperature_s <= self._temperature_s + RENEWED_S,
            measurement.displacement_age_s == 0.0 or not displacement_s <= self._displacement_s + RENEWED_S,
        )
        self._temperature_s, self._displacement_s = temperature_s, displacement_s
        return renewed


@dataclass(slots=True)
class Persistence:
    """Measures for how long a condition has lasted without a break, s."""

    _since_s: float | None = field(default=None, init=False)
    _time_s: float = field(default=0.0, init=False)

    def update(self, time_s: float, holds: bool | None) -> float:
        """Add one sample, and return for how long the condition has held, s.

        `holds` is None if it is unknown whether the condition holds. The result then stands still.
        """
        if self._since_s is None or holds is False:
            self._since_s = time_s
        elif holds is None:
            self._since_s += time_s - self._time_s
        self._time_s = time_s
        return time_s - self._since_s
