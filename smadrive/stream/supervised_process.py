"""A child process of the driver. A child that dies is restarted.

Work in a thread of the driver would delay the ticks, because Python runs one thread at a time. A child process only
competes for the processors, where the loop can have priority. The child gets its parameters as one line on its standard
input, and ends when its standard input ends: when the driver closes it or dies. If the child dies, a thread of the
driver tries to restart it until a restart succeeds. This thread almost only waits, so it does not delay the ticks.
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
from smadrive.files.extras import install_cure
from smadrive.numerics.blas_threads import ONE_THREAD
from smadrive.posix import check_posix

LOOK_S = 0.1
"""Period at which the thread checks that the child still runs."""

START_WITHIN_S = 60.0
"""A child that is not ready after this time is killed. On a small computer, a start takes some seconds."""

END_WITHIN_S = 3.0
RESTART_S = 0.5
"""Pause before a restart, so that a child that dies at once does not keep the machine busy."""


class SupervisedProcess:
    """The child process `python -m MODULE`, as a context manager.

    The child gets `parameters` and inherits the file descriptors `fds`; it answers with one line when it is ready. A
    positive `niceness` lowers the priority of the child, a negative one raises it if the system permits. `extra` names
    the optional dependencies that the child needs. ConfigError when the child does not start.
    """

    def __init__(
        self, module: str, parameters: dict[str, Any], fds: tuple[int, ...], *, extra: str, niceness: int = 0
    ) -> None:
        check_posix()
        self._module = module
        self._extra = extra
        self._niceness = niceness
        self._parameters = parameters
        self._fds = fds
        self._is_ending = threading.Event()
        self.deaths = 0
        self.restarts = 0
        self.trouble: str | None = None
        """The reason why the last restart failed. It is None if the last start succeeded."""

    @property
    def pid(self) -> int:
        """The process id of the child, which changes with a restart."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Start the child and wait until it is ready."""
        self._start()
        self._keeper = threading.Thread(target=self._keep, name=f"keeper of {self._module}", daemon=True)
        self._keeper.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the standard input of the child, so that it ends. Kill it if it still runs after `END_WITHIN_S`."""
        self._is_ending.set()
        self._keeper.join()  # the thread also ends a restart that has begun
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
            start_new_session=True,  # Ctrl-C reaches only the driver, which switches off and ends the child
        )
        try:
            _set_priority(self._process.pid, self._niceness)
            self._wait_until_ready()
        except BaseException as error:
            self._kill()
            if isinstance(error, OSError | ValueError):
                raise ConfigError(
                    "the process did not start; its own message, if any, is printed above",
                    where=self._module,
                    cure=f"correct the cause; if a package is missing, {install_cure(f'smadrive[{self._extra}]')}",
                ) from None
            raise

    def _wait_until_ready(self) -> None:
        """Send the parameters, and wait for the line of the child. OSError or ValueError when the line is missing."""
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise ValueError("the child process has no standard input or output")
        stdin.write(json.dumps(self._parameters) + "\n")
        stdin.flush()
        give_up_s = time.monotonic() + START_WITHIN_S
        while not select.select([stdout], [], [], LOOK_S)[0]:
            if self._is_ending.is_set() or time.monotonic() > give_up_s:
                raise TimeoutError
        json.loads(stdout.readline())

    def _kill(self) -> None:
        """Kill the child if it still runs, and close its pipes."""
        self._process.kill()
        self._process.wait()
        self._close_pipes()

    def _close_pipes(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # the process has ended before it read all data
                    pipe.close()

    def _keep(self) -> None:
        while not self._is_ending.wait(LOOK_S):
            if self._process.poll() is not None or self._is_frozen():
                self.deaths += 1
                self._kill()
                self._restart()

    def _is_frozen(self) -> bool:
        """Return True if the child runs but does not work. Called every `LOOK_S`; a subclass may override it."""
        return False

    def _restart(self) -> None:
        """Try to start the child until it runs or the context ends. A failure may be temporary: a lack of memory."""
        while not self._is_ending.wait(RESTART_S):
            try:
                self._start()
            except Exception as error:  # noqa: BLE001 (whatever the error is, OFF must work again)
                self.trouble = f"{self._module} did not start ({error}); next attempt in {RESTART_S:g} s"
            else:
                self.restarts += 1
                self.trouble = None
                return


def _set_priority(pid: int, niceness: int) -> None:
    """Set the niceness of a process, and of its session if Linux shares the processors among sessions (autogroup).

    Ignore the error if the process has already ended, or if the system does not permit this niceness.
    """
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        Path(f"/proc/{pid}/autogroup").write_text(str(niceness), encoding="ascii")
