"""The motions of a wire that are under way."""

from __future__ import annotations

from typing import NamedTuple

from smadrive.errors import MotionError
from smadrive.scripting.motion import Motion


class PendingMotion(NamedTuple):
    """A motion, and the error with which it ends if the servo ends before the motion; None for success."""

    motion: Motion
    interruption: MotionError | None


class PendingMotions:
    """The motions under way, each of which can be ended early."""

    def __init__(self) -> None:
        self._pending: list[PendingMotion] = []

    def add(self, motion: Motion, interruption: MotionError | None = None) -> Motion:
        """Keep the motion and return it. An early end without an error fails it with `interruption`, if any."""
        self._pending = [one for one in self._pending if not one.motion.done]
        self._pending.append(PendingMotion(motion, interruption))
        return motion

    def decide(self, error: MotionError | None) -> list[Motion]:
        """End all motions with `error`, and return those that were under way. No callback is called."""
        pending, self._pending = self._pending, []
        return [motion for motion, interruption in pending if motion.decide(error or interruption)]
