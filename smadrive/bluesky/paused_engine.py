"""The state of a run engine that has paused, and of the call that resumes it. Both need nothing of bluesky.

A run engine executes a plan in an asyncio task, which waits while the engine is paused. `RE.resume()` first calls
`resume` of each device and then lets the task go on. It waits for the end of the plan before it returns. So if this
call is over while the task still waits, an error or a Ctrl-C has ended the call, and the engine is still paused.
"""

from __future__ import annotations

import asyncio
import sys
import threading
from types import FrameType
from typing import Any


class PausedEngine:
    """A run engine whose `task` is paused now. Create it in the event loop of the task, so that the task waits."""

    def __init__(self, task: asyncio.Task[Any]) -> None:
        self._task = task
        self._awaited = self._present_await()

    @property
    def is_paused(self) -> bool:
        """True as long as the task waits for the end of this pause."""
        return not self._task.done() and self._present_await() is self._awaited

    def _present_await(self) -> object:
        return getattr(self._task.get_coro(), "cr_await", None)


class ResumeCall:
    """The call of a method in the present thread. `method` is the frame of the method; its caller is observed."""

    def __init__(self, method: FrameType | None) -> None:
        self._caller = None if method is None else method.f_back
        self._thread_id = threading.get_ident()

    @property
    def is_over(self) -> bool:
        """True if the caller has returned or raised an error. True also while a caller in a coroutine waits."""
        frame = sys._current_frames().get(self._thread_id)  # noqa: SLF001 (documented)
        while frame is not None and frame is not self._caller:
            frame = frame.f_back
        return frame is None
