"""The motions of a servo in the loop process: each decides from the ticks whether it has ended."""

from __future__ import annotations

from collections.abc import Iterator

from smadrive.control.loop import Tick
from smadrive.errors import MotionError
from smadrive.scripting.loop.servo.messages import FollowCommand, MotionCommand, MotionEnd, MoveCommand

ROUNDING_S = 1e-6
"""Largest rounding error of a time in a run."""


class MoveMotion:
    """The motion of a MoveCommand, whose path takes `path_s`. `is_over` is True after its end."""

    def __init__(self, command: MoveCommand, path_s: float) -> None:
        self._command = command
        self._path_s = path_s
        self._within_since_s: float | None = None
        self.is_over = False

    def update(self, tick: Tick, reference_s: float) -> Iterator[MotionEnd]:
        """Yield the end of the motion when it is done or has failed. `reference_s` counts from its beginning."""
        command, error_mm = self._command, tick.reached_mm - self._command.setpoint_mm
        if not abs(error_mm) <= command.tolerance_mm:  # also for NaN
            self._within_since_s = None
        elif self._within_since_s is None:
            self._within_since_s = reference_s
        since_s = self._within_since_s
        if since_s is not None and reference_s >= self._path_s and reference_s - since_s >= command.settle_s:
            self.is_over = True
            yield MotionEnd(command.number, None)
        elif reference_s > self._path_s + command.timeout_s:
            self.is_over = True
            yield MotionEnd(command.number, self._not_reached(error_mm))

    def superseded(self) -> Iterator[MotionEnd]:
        """Yield the end of this motion, which fails because another motion replaces it."""
        return superseded(self._command)

    def _not_reached(self, error_mm: float) -> MotionError:
        command = self._command
        return MotionError(
            f"not within the tolerance for {command.settle_s:g} s",
            where=f"move to {command.setpoint_mm:g} mm",
            value=f"{error_mm:.4g} mm away after {command.timeout_s:g} s",
            limit=f"{command.tolerance_mm:g} mm",
            cure="raise tolerance_mm or timeout_s, or lower speed_mm_per_s; is the model that of this wire?",
        )


class FollowMotion:
    """The two motions of a FollowCommand: the approach, and the approach with the reference.

    `command.reference` includes the approach. `is_over` is True after the end of the reference.
    """

    def __init__(self, command: FollowCommand) -> None:
        self._command = command
        self._is_begun = False
        self.is_over = False

    def update(self, _tick: Tick, reference_s: float) -> Iterator[MotionEnd]:
        """Yield the end of the approach, and the end of the reference. `reference_s` counts from the approach."""
        reference, rounded_s = self._command.reference, reference_s + ROUNDING_S
        if not self._is_begun and rounded_s >= reference.scored_from_s:
            self._is_begun = True
            yield MotionEnd(self._command.begun_number, None)
        if rounded_s >= reference.duration_s:
            self.is_over = True
            yield MotionEnd(self._command.number, None)

    def followed(self, reference_s: float) -> int | None:
        """Return the number of the command if the tick at `reference_s` is one of its reference, otherwise None."""
        reference = self._command.reference
        is_followed = reference.scored_from_s - ROUNDING_S <= reference_s <= reference.duration_s + ROUNDING_S
        return self._command.number if is_followed else None

    def superseded(self) -> Iterator[MotionEnd]:
        """Yield the ends of those of the two motions that have not ended. They fail: another motion replaces them."""
        ends = superseded(self._command)
        return (end for end in ends if not (self._is_begun and end.number == self._command.begun_number))


def superseded(command: MotionCommand) -> Iterator[MotionEnd]:
    """Yield the ends of the motions of a command before they begin. They fail: another motion replaces them."""
    if isinstance(command, MoveCommand):
        yield MotionEnd(command.number, _superseded(f"move to {command.setpoint_mm:g} mm"))
    else:
        yield MotionEnd(command.begun_number, _superseded("reference"))
        yield MotionEnd(command.number, _superseded("reference"))


def _superseded(where: str) -> MotionError:
    return MotionError("another motion has replaced it", where=where, cure="wait until a motion is done")
