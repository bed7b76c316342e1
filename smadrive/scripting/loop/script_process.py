"""The process of the script, as its loop process sees it: it runs, it has ended, or it is stopped.

A stopped process (Ctrl-Z, SIGSTOP, gdb) can neither command nor receive an interruption. So it must not heat for ever.
A script that only computes or waits is not stopped, and neither is one at a breakpoint of pdb or of an editor, because
its Python runs on. The state of the process is in /proc: where this folder is missing, no process counts as stopped.
"""

from __future__ import annotations

import os
from contextlib import suppress
from math import inf
from pathlib import Path

STOPPED_S = 10.0
"""A script that has been stopped for longer than this, in s, heats no longer."""

_STOPPED = ("T", "t")
"""The states of a stopped process in /proc/PID/stat: by a signal, and by a debugger."""


class ScriptProcess:
    """The process `pid` of the script. Look at it often: the methods see only its present state."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._stopped_since_s = inf

    def has_ended(self) -> bool:
        """Return True if the script, which is the parent of the calling process, has ended."""
        return os.getppid() != self._pid

    def has_run(self) -> None:
        """Note that the script has just sent a message, so that it cannot have been stopped."""
        self._stopped_since_s = inf

    def is_stopped(self, now_s: float) -> bool:
        """Return True if each look of the last `STOPPED_S` has found the script stopped. It is `now_s` now."""
        self._stopped_since_s = min(self._stopped_since_s, now_s) if self._state() in _STOPPED else inf
        return now_s - self._stopped_since_s > STOPPED_S

    def _state(self) -> str:
        """Return the state of the process; "" if it is unknown. The name before it may contain spaces and brackets."""
        with suppress(OSError, IndexError):
            return (
                Path(f"/proc/{self._pid}/stat")
                .read_text(encoding="utf-8", errors="replace")
                .rpartition(")")[2]
                .split()[0]
            )
        return ""
