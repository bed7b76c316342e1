"""Counts Ctrl-C and interruptions of a kernel during a request to the loop process. Nothing is raised in the script."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Self


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
