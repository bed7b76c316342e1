"""The messages between a servo of a script and the loop process: commands, and reports of the loop.

Each command except StopCommand has the number of a motion. The loop reports the end of this motion by its number.
"""

from __future__ import annotations

from typing import NamedTuple

from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.errors import SmadriveError


class MoveCommand(NamedTuple):
    """Move to `setpoint_mm` with at most `speed_mm_per_s`, and hold it.

    The motion is done when its path has ended and the displacement has stayed within `tolerance_mm` of the setpoint for
    `settle_s`. It fails if it is not done `timeout_s` after the end of its path.
    """

    number: int
    setpoint_mm: float
    speed_mm_per_s: float
    tolerance_mm: float
    settle_s: float
    timeout_s: float


class FollowCommand(NamedTuple):
    """Move to the beginning of `reference`, then track it.

    The motion `begun_number` ends when the tracking begins, the motion `number` when the reference ends.
    """

    number: int
    begun_number: int
    reference: Reference


MotionCommand = MoveCommand | FollowCommand


class SampleCommand(NamedTuple):
    """Report the next tick."""

    number: int


class StopCommand(NamedTuple):
    """End the run of the servo at zero current."""


ServoCommand = MotionCommand | SampleCommand | StopCommand


class MotionEnd(NamedTuple):
    """The end of a motion. `error` is None if the motion is done, and its error if it has failed."""

    number: int
    error: SmadriveError | None


class ServoTick(NamedTuple):
    """A tick, and the number of the FollowCommand whose reference it tracks; None during an approach or a move."""

    tick: Tick
    followed: int | None


class ServoReport(NamedTuple):
    """The latest ticks, and the motions that have ended by the last of these ticks.

    `dropped` is the number of ticks since the servo began that were not sent, because the script did not read.
    """

    ticks: tuple[ServoTick, ...]
    ended: tuple[MotionEnd, ...]
    dropped: int
