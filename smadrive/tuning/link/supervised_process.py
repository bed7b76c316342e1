"""A process beside the loop: started anew when it dies, ended with the session.

What is computed in the loop's own process, in whatever thread, takes the interpreter from a tick; what is computed in
another takes at most a processor, and there the loop can go first. It is told what it needs by one line on its standard
input, whose end tells it that the control process is gone, however it went. A thread waits for it, so that its death
and its new start take nothing from a tick. That thread tries until the new start succeeds, whatever goes wrong.
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
"""Pause before a new start: a process that dies at once must not keep the machine busy."""


class SupervisedProcess:
    """`python -m MODULE`, a context manager. It is told `told` and answers with one line once it is ready.

    ConfigError with `cure` when it does not come up. `niceness` is how far it stands back for others; below
    0 it goes before them, if the system grants that.
    """

    def __init__(
        self, module: str, told: dict[str, Any], fds: tuple[int, ...], cure: str, *, niceness: int = 0
    ) -> None:
        self._module = module
        self._niceness = niceness
        self._told = told
        self._fds = fds
        self._cure = cure
        self._is_ending = threading.Event()
        self.deaths = 0
        self.restarts = 0
        self.trouble: str | None = None
        """Why the last new start failed; None while the process runs."""

    @property
    def pid(self) -> int:
        """The present process."""
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
        self._keeper.join()  # it may be starting a process just now, and ends that itself
        self._hang_up()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_WITHIN_S)
        self._kill()

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", self._module],  # -P: no file of the present folder runs instead
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=self._fds,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is the control process's: it switches off, then ends what is beside it
        )
        try:
            _give_way(self._process.pid, self._niceness)
            self._told |= self._reply()  # what it chose: a port stays when it is started anew
        except BaseException as error:
            self._kill()
            if isinstance(error, OSError | ValueError):
                raise ConfigError(f"{self._module} did not start: see above; {self._cure}") from None
            raise

    def _reply(self) -> dict[str, Any]:
        """The line of the process that has been sent the parameters. OSError or ValueError without one."""
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise ValueError("no standard input and output")
        stdin.write(json.dumps(self._told) + "\n")
        stdin.flush()
        give_up_s = time.monotonic() + START_WITHIN_S
        while not select.select([stdout], [], [], LOOK_S)[0]:
            if self._is_ending.is_set() or time.monotonic() > give_up_s:
                raise TimeoutError
        reply: dict[str, Any] = json.loads(stdout.readline())
        return reply

    def _kill(self) -> None:
        """Whether it still runs or not: afterwards it does not, and its pipes are closed."""
        self._process.kill()
        self._process.wait()
        self._hang_up()

    def _hang_up(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what was still to be written to a process that has gone
                    pipe.close()

    def _keep(self) -> None:
        while not self._is_ending.wait(LOOK_S):
            if self._process.poll() is not None or self._is_frozen():
                self.deaths += 1
                self._kill()
                self._restart()

    def _is_frozen(self) -> bool:
        """Whether the process runs without doing its work; asked every LOOK_S. Here this is not known."""
        return False

    def _restart(self) -> None:
        """Try until it runs, or is not needed any more: a lack of memory or of descriptors passes."""
        while not self._is_ending.wait(RESTART_S):
            try:
                self._start()
            except Exception as error:  # noqa: BLE001 (whatever it is, OFF must come back)
                self.trouble = f"{self._module} did not start ({error}): it is tried again every {RESTART_S:g} s"
            else:
                self.restarts += 1
                self.trouble = None
                return


def _give_way(pid: int, niceness: int) -> None:
    """Set its priority, and on Linux that of its session: there sessions share the processors, whoever is in them.

    A process that has ended already is found out elsewhere. What the system does not grant is left.
    """
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        Path(f"/proc/{pid}/autogroup").write_text(str(niceness), encoding="ascii")
