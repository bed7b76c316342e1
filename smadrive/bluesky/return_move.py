"""The return of a wire to its setpoint after a pause of the run engine."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from smadrive.bluesky.paused_engine import PausedEngine, ResumeCall
from smadrive.bluesky.setpoint import Setpoint
from smadrive.errors import MotionError
from smadrive.scripting.motion import Motion

End = Callable[[MotionError], None]

CHECK_S = 0.05
"""Period in s of the check that the engine goes on."""


class ReturnMove:
    """Moves the wire back to the setpoint that a pause has kept. If the engine stays paused, the heater goes off.

    A paused engine handles no Ctrl-C and stops no device, so it must not leave a heated wire. The setpoint stays kept
    after a failed return: the next `RE.resume()` moves the wire again.
    """

    def __init__(self, name: str, setpoint: Setpoint) -> None:
        self._name = name
        self._setpoint = setpoint
        self._motion: Motion | None = None
        self._guard: asyncio.Task[None] | None = None

    async def run(self, call: ResumeCall, move: Callable[[float], Motion], end: End) -> None:
        """Return when the wire has settled. If the move fails, its error is raised with the heater off.

        MotionError if `call` is over while the engine is paused. Nothing moves if the pause has kept no setpoint.

        move    begins the move to a displacement in mm
        end     ends all motions with an error, and switches the heater off
        """
        if self._guard is not None and not self._guard.done():
            await self._guard
        setpoint_mm = self._setpoint.paused_mm
        if setpoint_mm is None:
            return
        engine = self._paused_engine()
        if engine is not None and call.is_over:
            raise self._still_paused()
        motion = self._motion = move(setpoint_mm)
        self._setpoint.resume()
        if engine is not None:
            self._guard = asyncio.create_task(self._end_with(call, engine, motion, end))
            self._guard.add_done_callback(_show_error)
        error = await asyncio.to_thread(motion.exception, None)
        if error is not None:
            self._give_up(motion, end)
            raise error

    def _paused_engine(self) -> PausedEngine | None:
        """Return the engine that has paused the wire. None if its task runs: a suspended plan goes on by itself."""
        task = self._setpoint.paused_task
        return None if task is None or task is asyncio.current_task() else PausedEngine(task)

    async def _end_with(self, call: ResumeCall, engine: PausedEngine, motion: Motion, end: End) -> None:
        """Give up if the call that resumes the engine is over before the engine goes on."""
        while engine.is_paused:
            if call.is_over:
                self._give_up(motion, end)
                return
            await asyncio.sleep(CHECK_S)

    def _give_up(self, motion: Motion, end: End) -> None:
        """Switch the heater off, and keep the setpoint, unless this has been done or a later return has begun."""
        if self._motion is motion:
            self._motion = None
            self._setpoint.pause_again()
            end(self._still_paused())

    def _still_paused(self) -> MotionError:
        what = "the run engine is still paused, so the heater is off"
        return MotionError(what, where=self._name, cure="call RE.resume() again, or RE.abort()")


def _show_error(guard: asyncio.Task[None]) -> None:
    """Show the error of a heater that is not confirmed off. The call that could raise it is over."""
    error = None if guard.cancelled() else guard.exception()
    if error is not None:
        what = "the run engine is still paused, and the heater could not be switched off"
        guard.get_loop().call_exception_handler({"message": what, "exception": error, "task": guard})
