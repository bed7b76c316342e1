"""Undo and redo: a list of tunings, and the place of the present tuning in the list.

A slider that is dragged makes many changes. Changes with the same name count as one step of undo if each follows the
previous one within `DRAG_S`. Successive changes of the online adaptation always count as one step.
"""

from __future__ import annotations

from smadrive.identification.adaptation.adaptation import ADAPTED
from smadrive.tuning.tuning import Tuning

DRAG_S = 1.5
MAX_TUNINGS = 200


class History:
    """The present tuning, the earlier tunings for undo, and the later tunings for redo; at most `MAX_TUNINGS`."""

    def __init__(self, first: Tuning) -> None:
        self._line = [first]
        self._at = 0
        self._changed_s = float("-inf")

    @property
    def now(self) -> Tuning:
        """The present tuning."""
        return self._line[self._at]

    @property
    def undo_name(self) -> str | None:
        """The name of the change that undo would take back. It is None if there is no such change."""
        return self._line[self._at].change if self._at else None

    @property
    def redo_name(self) -> str | None:
        """The name of the change that redo would make again. It is None if there is no such change."""
        return self._line[self._at + 1].change if self._at + 1 < len(self._line) else None

    def push(self, tuning: Tuning, time_s: float) -> None:
        """Add the tuning that a new change has made. Changes that could be redone before are forgotten."""
        goes_on = (
            self._at > 0
            and tuning.change == self.now.change
            and (tuning.change == ADAPTED or time_s - self._changed_s < DRAG_S)
        )
        keep = self._at if goes_on else self._at + 1
        self._line = [*self._line[:keep], tuning][-MAX_TUNINGS:]
        self._at = len(self._line) - 1
        self._changed_s = time_s

    def peek(self, step: int) -> Tuning | None:
        """Return the tuning that undo (`step` -1) or redo (`step` +1) leads to. Return None if there is none."""
        at = self._at + step
        return self._line[at] if 0 <= at < len(self._line) else None

    def move(self, step: int) -> None:
        """Go to the tuning that undo (`step` -1) or redo (`step` +1) leads to. There must be such a tuning."""
        self._at += step
        self._changed_s = float("-inf")
