"""Interruptions of a request: how the script counts them, and when they act in the loop process.

During a request, nothing is raised in the script: Ctrl-C, and an interruption of the kernel of a notebook, are counted
and passed on. In the loop process a signal acts as its phase says:

    phase           what the main thread does            an interruption         the end of the script
    WAITING         waits for a request, or replies      has no effect           acts at once
    RESTORING       unpickles a request: user's code     acts at once            acts at once
    CARRYING_OUT    uses the devices                     acts at the next tick   acts at the next tick
    OWN_CODE        runs code that uses no device        acts at once            acts at once

`smadrive off` interrupts WAITING, too. The user's code may catch a signal that acts at once: it acts again before the
request begins, or at the next tick. An interruption that arrives before the main thread has taken its request acts
before the request begins.
"""

from __future__ import annotations

import signal
import threading
from enum import Enum, auto
from types import FrameType, TracebackType
from typing import Self


class Phase(Enum):
    """A phase of the main thread, as in the table at the head of this file."""

    WAITING = auto()
    RESTORING = auto()
    CARRYING_OUT = auto()
    OWN_CODE = auto()


INTERRUPTIBLE = frozenset({Phase.RESTORING, Phase.CARRYING_OUT, Phase.OWN_CODE})
AT_ONCE = frozenset({Phase.WAITING, Phase.RESTORING, Phase.OWN_CODE})
"""The phases in which a signal acts at once. In the other one it acts at the next tick."""


class CountedInterrupts:
    """A context manager that counts SIGINT in `count`. An ignored SIGINT stays ignored.

    Outside the main thread nothing is counted, because signals arrive in the main thread only.
    """

    def __init__(self) -> None:
        self.count = 0
        self._is_installed = False

    def __enter__(self) -> Self:
        """Count from now on."""
        if threading.current_thread() is threading.main_thread():
            handler = signal.getsignal(signal.SIGINT)
            if handler is not None and handler != signal.SIG_IGN:
                self._handler = handler
                signal.signal(signal.SIGINT, self._count)
                self._is_installed = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signal back to the handler of the script."""
        if self._is_installed:
            signal.signal(signal.SIGINT, self._handler)

    def _count(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
