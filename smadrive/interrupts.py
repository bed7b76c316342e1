"""Holds back the signals that end a program while the heater is being switched off.

SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal) normally unwind the program. A signal that interrupted the
switching off would leave the heater on. `HeldSignals` therefore counts these signals while its block lasts. The user
can still end the wait for a device that never answers: the `ABORTS_AT`-th signal ends the block.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Self

SIGNALS = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

Handler = Callable[[int, FrameType | None], Any] | int

ABORTS_AT = 3
"""The signal with this number ends the block of `HeldSignals`; the earlier signals are only counted."""


def unblock_signals() -> None:
    """Let `SIGNALS` reach this thread, even if the parent of this process has blocked them: it must stay stoppable."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


@contextmanager
def signals_obeyed_afterwards() -> Iterator[None]:
    """Hold the signals in the `with` block, then call the program's own handlers, which may raise an error."""
    with HeldSignals() as held:
        yield
    for number in held.received:
        signal.raise_signal(number)


class AbortedError(KeyboardInterrupt):
    """`ABORTS_AT` signals arrived while signals were held."""


class HeldSignals:
    """A context manager that counts `SIGNALS` instead of obeying them.

    `received` lists the signals of an earlier block (`before`), then the signals that arrived in the `with` block.
    The `ABORTS_AT`-th signal ends the block with AbortedError. At the end of the block, the program's own handler is
    called for this signal, and may raise another error instead. The caller decides about the earlier signals. Ignored
    signals stay ignored. Outside the main thread no signal is held, because signals arrive in the main thread only.
    """

    def __init__(self, before: Sequence[signal.Signals] = ()) -> None:
        self.received = [*before]
        self._handlers: dict[int, Handler] = {}
        self._mask: set[int] = set()
        self._is_active = self._may_abort = False

    @property
    def aborted(self) -> bool:
        """True if `ABORTS_AT` signals arrived, which ended the block."""
        return len(self.received) >= ABORTS_AT

    def __enter__(self) -> Self:
        """Hold the signals from now on."""
        if threading.current_thread() is threading.main_thread():
            self._mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
            try:
                self._is_active = True
                signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # a handler may raise: all are replaced first
                for number in SIGNALS:
                    handler = signal.getsignal(number)
                    if handler is not None and handler != signal.SIG_IGN:
                        self._handlers[number] = handler
                        signal.signal(number, self._count)
                signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
                self._may_abort = True
            except BaseException:  # of the handler of another signal, or of one that another thread has taken
                self._is_active = False
                signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signals back to the program's own handlers."""
        if not self._is_active:
            return
        try:
            self._may_abort = False
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # a handler may raise: all are restored first
            for number, handler in self._handlers.items():
                signal.signal(number, handler)
        finally:
            self._is_active = False
            signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
        if isinstance(error, AbortedError):
            signal.raise_signal(self.received[-1])

    def _count(self, number: int, _frame: FrameType | None) -> None:
        if not self._is_active:  # the error of another handler has cut the block before this one was restored
            signal.signal(number, self._handlers[number])
            signal.raise_signal(number)
            return
        self.received.append(signal.Signals(number))
        if self._may_abort and self.aborted:
            self._may_abort = False
            raise AbortedError(f"{ABORTS_AT} signals")
