"""Debouncing: a condition that noise can fake counts once it holds for several samples."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass(slots=True)
class Debounce:
    """True when `needed` of the last `window` samples were bad."""

    needed: int
    window: int
    _recent: deque[bool] = field(init=False)

    def __post_init__(self) -> None:
        """Begin with no sample."""
        self._recent = deque(maxlen=self.window)

    def update(self, bad: bool) -> bool:
        """Whether the condition counts, now that the next sample is `bad` or not."""
        if not (bad or self._recent):
            return False
        self._recent.append(bad)
        count = sum(self._recent)
        if not count:
            self._recent.clear()
        return count >= self.needed
