"""The loop process, as the script that has started it sees it: a child process that is waited for, or killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

from smadrive.errors import LoopProcessError, StoppedError
from smadrive.numerics.blas_threads import ONE_THREAD

MODULE = "smadrive.scripting.loop.loop_process"

ENDS_WITHIN_S = 30.0
"""The loop process is killed if it has not ended after this time in s. Two tries to switch off take some 20 s."""


class LoopChild:
    """Starts a loop process that inherits the socket `descriptor`, its end of the link.

    `stop` is the error with which the process has said that `smadrive off` stopped it; None without such an error.
    """

    def __init__(self, descriptor: int) -> None:
        self.stop: StoppedError | None = None
        self._death: LoopProcessError | None = None
        self._raised = threading.local()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", MODULE, str(descriptor)],
            stdin=subprocess.DEVNULL,
            pass_fds=[descriptor],
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is for the script, which passes it on
        )

    @property
    def pid(self) -> int:
        """The id of the process."""
        return self._process.pid

    def wait(self) -> None:
        """Wait for the end of the process. If it has not ended after `ENDS_WITHIN_S`, kill it."""
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.kill()

    def kill(self) -> None:
        """Kill the process. The watchdog of the device or the guardian then switches the heater off."""
        self._process.kill()
        self._process.wait()

    def error(self) -> StoppedError | LoopProcessError:
        """Wait for the end of the process. Return the error that tells how it has ended, the same object each time."""
        self.wait()
        if self.stop is not None:
            return self.stop
        if self._death is None:
            self._death = self._how_it_died()
        return self._death

    def note_raised(self, error: BaseException) -> None:
        """Remember that the present thread raises `error`, if this error tells how the process has ended."""
        if error in (self.stop, self._death):
            self._raised.is_error = True

    @property
    def is_error_raised(self) -> bool:
        """True if the present thread has raised the error that tells how the process has ended."""
        return getattr(self._raised, "is_error", False)

    def _how_it_died(self) -> LoopProcessError:
        code = self._process.returncode
        if code == 0:
            what, cure = "it has ended: the rig was closed, or a signal or an error stopped it", "open the rig again"
            return LoopProcessError(what, where="loop process", cure=cure)
        return LoopProcessError(
            "it has died; the watchdog of the device, or the guardian, switches the heater off",
            where="loop process",
            value=f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}",
            cure="confirm with `smadrive off RIG` that the heater is off, then open the rig again",
        )
