"""A motion of a servo as a script sees it: it is under way, done or failed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import count

from smadrive.errors import MotionError
from smadrive.posix import OwningProcess
from smadrive.scripting.callbacks import check_may_wait, succeeds


class Motion:
    """A motion, or the wait for a fresh measurement. All methods may be called from any thread.

        servo.move(4.0).wait()

    It has the methods of a bluesky Status.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._owner = OwningProcess()
        self._is_over = threading.Event()
        self._mutex = threading.Lock()
        self._callbacks: list[Callable[[Motion], None]] = []
        self._error: BaseException | None = None

    @property
    def done(self) -> bool:
        """True once the motion has succeeded or failed."""
        return self._is_over.is_set()

    @property
    def success(self) -> bool:
        """True once the motion has succeeded; False while it is under way, and if it has failed."""
        return self.done and self._error is None

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """Wait up to `timeout` seconds for the end of the motion; None waits without a limit.

        Return the error of the motion, or None if it has succeeded. MotionError if it is still under way, also at once
        in a function that is called with a tick or at the end of a motion: it must not wait. ConfigError in a forked
        child, where a motion that is under way does not end.
        """
        if not self.done:
            self._owner.check()
            check_may_wait(self._what)
        if not self._is_over.wait(timeout):
            cure = "wait longer"
            raise MotionError("is still under way", where=self._what, value=f"{timeout:g} s", cure=cure)
        return self._error

    def wait(self, timeout: float | None = None) -> None:
        """Wait up to `timeout` seconds for the end of the motion; None waits without a limit.

        Raise the error of the motion if it has failed. MotionError if it is still under way, in the same cases as in
        `exception`.
        """
        error = self.exception(timeout)
        if error is not None:
            raise error

    def add_callback(self, callback: Callable[[Motion], None]) -> None:
        """Call `callback` with this motion when it ends. If it has ended already, call `callback` now.

        A later call is in another thread. There `callback` must not wait for a motion or use the rig; it may give new
        commands to the servo, and stop it. An error of a later call is shown with its traceback, and changes nothing.
        """
        with self._mutex:
            if not self.done:
                self._callbacks.append(callback)
                return
        callback(self)

    def finish(self, error: BaseException | None = None) -> None:
        """End the motion. With `error` it has failed, without `error` it has succeeded. Later calls have no effect."""
        if self.decide(error):
            self.call_back()

    def decide(self, error: BaseException | None = None) -> bool:
        """End the motion as `finish` does, but call no callback: `call_back` does it. Return False if it had ended."""
        with self._mutex:
            if self.done:
                return False
            self._error = error
            self._is_over.set()
        return True

    def call_back(self) -> None:
        """Call the callbacks of a motion that `decide` has ended."""
        for callback in self._callbacks:
            succeeds(callback, self)

    def __repr__(self) -> str:
        state = "under way" if not self.done else "done" if self._error is None else f"failed: {self._error}"
        return f"Motion({self._what}, {state})"


class RunMotions:
    """The motions of the run of a servo, by their numbers. All methods may be called from any thread."""

    def __init__(self) -> None:
        self._numbers = count(1)
        self._mutex = threading.Lock()
        self._under_way: dict[int, Motion] = {}
        self._end: BaseException | None = None

    @property
    def are_over(self) -> bool:
        """True once the run has ended."""
        return self._end is not None

    def begin(self, what: str) -> tuple[int, Motion]:
        """Return the number of a new motion, and the motion. If the run has ended, the motion has failed."""
        motion = Motion(what)
        with self._mutex:
            number, end = next(self._numbers), self._end
            if end is None:
                self._under_way[number] = motion
        if end is not None:
            motion.finish(end)
        return number, motion

    def finish(self, number: int, error: BaseException | None) -> None:
        """End a motion, if it is under way. Without `error` it has succeeded."""
        with self._mutex:
            motion = self._under_way.pop(number, None)
        if motion is not None:
            motion.finish(error)

    def end(self, error: BaseException) -> None:
        """Fail the motions under way with the error that has ended the run, and also those that begin later."""
        with self._mutex:
            left, self._end = list(self._under_way.values()), error
            self._under_way.clear()
        for motion in left:
            motion.finish(error)


def run_ended() -> MotionError:
    """Return the error of a motion whose run has ended."""
    return MotionError("the run has ended", where="servo", cure="start the servo again")
