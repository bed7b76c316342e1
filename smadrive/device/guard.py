"""The driver's end of the guardian: starts it, keeps it informed, learns from it when it has taken over."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from types import TracebackType
from typing import IO, Self

from smadrive.device.guardian import BEAT, READY, REST, TAKEN, WATCH, Task
from smadrive.errors import SafetyError, TakenOverError

STARTS_WITHIN_S = 20.0
ENDS_WITHIN_S = 5.0
PATIENCE = 2.0
"""So many times its own patience with the driver is the driver's with it."""
MANY = 4096
GONE = "the guardian is gone or stands still: heating without it is refused"


class Guard:
    """A guardian process for `task`, a context manager: leaving it ends the guardian, unless heat may still flow."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._watching = False
        self._heard_s = 0.0

    def __enter__(self) -> Self:
        """Start the guardian and wait until it is ready; SafetyError when it does not come up."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "smadrive.device.guardian"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is the driver's
        )
        self._to, self._from = _piped(self._process.stdin), _piped(self._process.stdout)
        self._to.write(self._task.to_json())
        ready, _, _ = select.select((self._from,), (), (), STARTS_WITHIN_S)
        if not ready or self._from.read(1) != READY:
            self._process.kill()
            raise SafetyError("the guardian did not start: heating a source without a watchdog is refused without it")
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes: the guardian ends, at once when the source is confirmed off."""
        self._to.close()
        self._from.close()
        if not self._watching:
            self._process.wait(ENDS_WITHIN_S)

    def watch(self) -> None:
        """Heating begins."""
        self._heard_s = time.monotonic()
        self._tell(WATCH)
        self._watching = True

    def beat(self) -> None:
        """The driver lives, and is about to command.

        TakenOverError when the guardian holds the source; SafetyError when it does not answer any more.
        """
        if self._watching:
            heard = self._from.read(MANY) or b""
            now_s = time.monotonic()
            if TAKEN in heard:
                raise TakenOverError(
                    f"the driver stood still for more than {self._task.timeout_s:g} s and the guardian switched the "
                    "heater off"
                )
            if heard:
                self._heard_s = now_s
            elif now_s - self._heard_s > PATIENCE * self._task.timeout_s:
                raise SafetyError(GONE)
            self._tell(BEAT)

    def rest(self) -> None:
        """The source is confirmed off."""
        if self._watching:
            self._watching = False
            self._tell(REST)

    def _tell(self, what: bytes) -> None:
        try:
            written = self._to.write(what)
        except OSError:
            written = None
        if not written:
            raise SafetyError(GONE)


def _piped(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None  # both ends are pipes
    return end
