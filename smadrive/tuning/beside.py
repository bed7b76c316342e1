"""A process beside the loop: started anew when it dies, ended with the session.

What is computed in the loop's own process, in whatever thread, takes the interpreter from a tick; what is computed in
another takes at most a processor, and there the loop can go first. It is told what it needs by one line on its standard
input, whose end tells it that the control process is gone, however it went. A thread waits for it, so that its death
and its new start take nothing from a tick.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.errors import ConfigError
from smadrive.onethread import ONE_THREAD

END_WITHIN_S = 3.0
RESTART_S = 0.5
"""Pause before a new start: a process that dies at once must not keep the machine busy."""


class Beside:
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
        self._hang_up()
        try:
            self._process.wait(END_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._keeper.join(END_WITHIN_S)

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
        if self._process.stdin is None or self._process.stdout is None:
            raise ConfigError(f"{self._module} has no standard input and output")
        _give_way(self._process.pid, self._niceness)
        try:
            self._process.stdin.write(json.dumps(self._told) + "\n")
            self._process.stdin.flush()
            self._told |= json.loads(
                self._process.stdout.readline()
            )  # what it chose: a port stays when it is started anew
        except (OSError, ValueError):
            self._process.wait()
            self._hang_up()
            raise ConfigError(f"{self._module} did not start: see above; {self._cure}") from None

    def _hang_up(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _keep(self) -> None:
        while True:
            self._process.wait()
            if self._is_ending.is_set():
                return
            self.deaths += 1
            self._hang_up()
            time.sleep(RESTART_S)
            try:
                self._start()
            except ConfigError:
                continue
            self.restarts += 1


def _give_way(pid: int, niceness: int) -> None:
    """Set its priority, and on Linux that of its session: there sessions share the processors, whoever is in them.

    A process that has ended already is found out elsewhere. What the system does not grant is left.
    """
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        Path(f"/proc/{pid}/autogroup").write_text(str(niceness), encoding="ascii")
