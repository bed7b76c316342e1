"""Debouncing: a condition that noise can cause is real only when several samples show it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass(slots=True)
class Debounce:
    """Decides if a condition is real: at least `needed` of the last `window` samples were bad."""

    needed: int
    window: int
    _recent: deque[bool] = field(init=False)

    def __post_init__(self) -> None:
        """Begin with no sample."""
        self._recent = deque(maxlen=self.window)

    def update(self, bad: bool) -> bool:
        """Add one sample, and return True if at least `needed` of the last `window` samples were bad."""
        if not (bad or self._recent):
            return False
        self._recent.append(bad)
        count = sum(self._recent)
        if not count:
            self._recent.clear()
        return count >= self.needed
