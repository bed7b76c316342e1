"""Debouncing: a condition that noise can cause counts only when several of the latest samples show it."""

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
