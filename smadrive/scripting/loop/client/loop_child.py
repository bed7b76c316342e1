"""The loop process, as the script that has started it sees it: a child process that is waited for, or killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from smadrive.errors import LoopProcessError
from smadrive.numerics.blas_threads import ONE_THREAD

MODULE = "smadrive.scripting.loop.loop_process"

ENDS_WITHIN_S = 30.0
"""The loop process is killed if it has not ended after this time in s. Two tries to switch off take some 20 s."""


class LoopChild:
    """Starts a loop process that inherits the socket `descriptor`, its end of the link."""

    def __init__(self, descriptor: int) -> None:
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

    def error(self) -> LoopProcessError:
        """Wait for the end of the process, and return the error that tells how it has ended."""
        self.wait()
        code = self._process.returncode
        if code == 0:
            what, cure = "it has ended, because a signal or an error stopped it", "open the rig again"
            return LoopProcessError(what, where="loop process", cure=cure)
        return LoopProcessError(
            "it has died; the watchdog of the device, or the guardian, switches the heater off",
            where="loop process",
            value=f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}",
            cure="confirm with `smadrive off RIG` that the heater is off, then open the rig again",
        )
