"""A quantity that changes linearly to a new value within a given time."""

from __future__ import annotations


class Ramp:
    """A quantity with the present `value`. `begin` starts a change, `advance` lets time pass.

    `is_changing` is True until the change is over.
    """

    def __init__(self, value: float) -> None:
        self.value = value
        self.is_changing = False
        self._target = value
        self._left_s = 0.0

    def begin(self, target: float, over_s: float) -> None:
        """Change the value to `target`, linearly within `over_s`. This replaces a change that is not over yet."""
        self._target, self._left_s, self.is_changing = target, over_s, True

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        if not self.is_changing:
            return
        if dt_s >= self._left_s:
            self.value, self.is_changing = self._target, False
        else:
            self.value += (self._target - self.value) * dt_s / self._left_s
            self._left_s -= dt_s
