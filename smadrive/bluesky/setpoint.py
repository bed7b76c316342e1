"""The setpoint of a wire, and the one to which the wire returns after a pause of the run engine."""

from __future__ import annotations

import asyncio
from typing import Any, NamedTuple


class HeldSetpoint(NamedTuple):
    """A displacement in mm, and the asyncio task in which it was set; None outside an event loop."""

    value_mm: float
    task: asyncio.Task[Any] | None


class Setpoint:
    """The setpoint in force, and what `stop` and `pause` keep of it.

    A run engine calls `stop` at the end of a plan, and also right before `pause`. It executes every plan in a task of
    its own, and stops at the end of a plan what this plan has set. So a pause keeps a setpoint only if it ends the
    servo that holds the wire there, or if the paused plan has set it. Any other setpoint would heat a cold wire after
    the resume, and the run engine would not stop it.
    """

    def __init__(self) -> None:
        self._in_force: HeldSetpoint | None = None
        self._stopped: HeldSetpoint | None = None
        self._paused: HeldSetpoint | None = None
        self._paused_task: asyncio.Task[Any] | None = None

    def value_or(self, readback_mm: float) -> float:
        """Return the setpoint in force, in mm, or without one the displacement that was read."""
        return readback_mm if self._in_force is None else self._in_force.value_mm

    def set(self, value_mm: float) -> None:
        """Put a displacement in mm in force."""
        self._in_force = HeldSetpoint(value_mm, _current_task())

    def release(self) -> None:
        """Take the setpoint out of force without a stop: the wire follows a reference."""
        self._in_force = None

    def stop(self) -> None:
        """Take the setpoint out of force. A `pause` can still keep it; a second `stop` forgets it.

        A setpoint that a pause has kept is treated like one in force, because a suspended plan can be paused, too.
        """
        self._stopped = self._paused if self._in_force is None else self._in_force
        self._in_force = self._paused = None

    def pause(self, *, is_held: bool) -> None:
        """Take the setpoint out of force and keep it for `resume`. `is_held`: a servo holds the wire there."""
        task = _current_task()
        ended = self._in_force or self._stopped
        kept = self._paused if self._paused_task is task else None
        if self._in_force is not None and is_held:
            kept = self._in_force
        elif ended is not None and ended.task is task is not None:
            kept = ended
        self._in_force = self._stopped = None
        self._paused, self._paused_task = kept, task

    @property
    def paused_mm(self) -> float | None:
        """The setpoint that the pause has kept, in mm. None without one, or if an abort has ended the paused plan."""
        is_ended = self._paused_task is not None and self._paused_task.done()
        return None if self._paused is None or is_ended else self._paused.value_mm

    @property
    def paused_task(self) -> asyncio.Task[Any] | None:
        """The asyncio task that has called the latest `pause`; None outside an event loop."""
        return self._paused_task

    def resume(self) -> None:
        """Put the setpoint that the pause has kept in force again, as a setpoint of the plan that has set it."""
        self._in_force, self._paused = self._paused, None

    def pause_again(self) -> None:
        """Undo `resume`: take the setpoint out of force, and keep it for the next `resume`."""
        if self._in_force is not None:
            self._in_force, self._paused = None, self._in_force


def _current_task() -> asyncio.Task[Any] | None:
    """Return the asyncio task that calls, or None outside an event loop."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None
