"""Two ways to wait before a condition counts: until several samples show it, or until it has lasted for some time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass(slots=True)
class Debounce:
    """Debounces one condition. The condition counts when at least `needed` of the last `window` samples showed it."""

    needed: int
    window: int
    _recent: deque[bool] = field(init=False)

    def __post_init__(self) -> None:
        """Start without samples."""
        self._recent = deque(maxlen=self.window)

    def update(self, bad: bool) -> bool:
        """Add one sample; `bad` is True if it shows the condition. Return True if the condition counts."""
        if not (bad or self._recent):
            return False
        self._recent.append(bad)
        count = sum(self._recent)
        if not count:
            self._recent.clear()
        return count >= self.needed


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
