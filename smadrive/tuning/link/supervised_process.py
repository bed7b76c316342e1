"""A process beside the loop: restarted when it dies, ended with the session.

Work in a thread of the loop's own process takes the interpreter from a tick. Work in another process takes a processor
at most, and there the loop can have priority. The process gets its parameters as one line on its standard input; the
end of its standard input tells it that the control process has gone, however that ended. A thread waits for the
process, so that its death and its restart take nothing from a tick; it tries until a restart succeeds.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.errors import ConfigError
from smadrive.numerics.blas_threads import ONE_THREAD

LOOK_S = 0.1
"""How often the thread looks whether the process still runs."""

START_WITHIN_S = 60.0
"""A process that is not ready by then is killed; a small computer needs some seconds."""

END_WITHIN_S = 3.0
RESTART_S = 0.5
"""Pause before a restart: a process that dies at once must not keep the machine busy."""


class SupervisedProcess:
    """`python -m MODULE`, a context manager. It gets `parameters`, and answers with one line when it is ready.

    It inherits the descriptors `fds`. `niceness` lowers its priority; below 0 it raises it, where the system grants
    that. ConfigError when it does not start.
    """

    def __init__(self, module: str, parameters: dict[str, Any], fds: tuple[int, ...], *, niceness: int = 0) -> None:
        self._module = module
        self._niceness = niceness
        self._parameters = parameters
        self._fds = fds
        self._is_ending = threading.Event()
        self.deaths = 0
        self.restarts = 0
        self.trouble: str | None = None
        """Why the last restart failed; None while the process runs."""

    @property
    def pid(self) -> int:
        """The process id of the present process."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Start it and wait until it is ready."""
        self._start()
        self._keeper = threading.Thread(target=self._keep, name=f"keeper of {self._module}", daemon=True)
        self._keeper.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        self._is_ending.set()
        self._keeper.join()  # a restart that is under way is ended there
        self._close_pipes()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_WITHIN_S)
        self._kill()

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", self._module],  # -P: modules of the present folder are not imported
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=self._fds,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C goes to the control process: it switches off, then ends this process
        )
        try:
            _set_priority(self._process.pid, self._niceness)
            self._wait_until_ready()
        except BaseException as error:
            self._kill()
            if isinstance(error, OSError | ValueError):
                raise ConfigError(
                    "the process did not start: see above", where=self._module, cure="check the installation"
                ) from None
            raise

    def _wait_until_ready(self) -> None:
        """Send the parameters and wait for the line of the process. OSError or ValueError without one."""
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise ValueError("no standard input and output")
        stdin.write(json.dumps(self._parameters) + "\n")
        stdin.flush()
        give_up_s = time.monotonic() + START_WITHIN_S
        while not select.select([stdout], [], [], LOOK_S)[0]:
            if self._is_ending.is_set() or time.monotonic() > give_up_s:
                raise TimeoutError
        json.loads(stdout.readline())

    def _kill(self) -> None:
        """Kill it if it still runs, and close its pipes."""
        self._process.kill()
        self._process.wait()
        self._close_pipes()

    def _close_pipes(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # unsent data for a process that has gone
                    pipe.close()

    def _keep(self) -> None:
        while not self._is_ending.wait(LOOK_S):
            if self._process.poll() is not None or self._is_frozen():
                self.deaths += 1
                self._kill()
                self._restart()

    def _is_frozen(self) -> bool:
        """Whether the process runs but does not work; called every LOOK_S. A subclass may know; here it is False."""
        return False

    def _restart(self) -> None:
        """Try until it runs or the session ends: a lack of memory or of descriptors passes."""
        while not self._is_ending.wait(RESTART_S):
            try:
                self._start()
            except Exception as error:  # noqa: BLE001 (after any error OFF must come back)
                self.trouble = f"{self._module} did not start ({error}): it is tried again every {RESTART_S:g} s"
            else:
                self.restarts += 1
                self.trouble = None
                return


def _set_priority(pid: int, niceness: int) -> None:
    """Set its niceness, and on Linux that of its session: there sessions share the processors among each other.

    A process that has already ended is found by the keeper. A priority that the system does not grant is left as it is.
    """
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        Path(f"/proc/{pid}/autogroup").write_text(str(niceness), encoding="ascii")
