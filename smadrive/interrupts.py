"""Holds back the signals that end a program while the heater is being switched off.

SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal) normally unwind the program. A signal that interrupted the
switching off would leave the heater on. `HeldSignals` therefore counts these signals while its block lasts. The user
can still end the wait for a device that never answers: the `ABORTS_AT`-th signal ends the block.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
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


class ReplacedHandlers:
    """Signal handlers of the program, with `handle(number, frame, handler)` called in the place of each `handler`.

    Python calls a handler between any two instructions, and a handler may raise. So the signals are blocked while their
    handlers are replaced or restored. If an error of another handler cuts the restoring, each handler that is left
    gives way to the program's own at its next signal.
    """

    def __init__(self, handle: Callable[[int, FrameType | None, Handler], None]) -> None:
        self._handle = handle
        self._handlers: dict[int, Handler] = {}
        self._mask: set[int] = set()
        self._is_active = False

    def replace(self, numbers: Iterable[int], is_replaced: Callable[[int, Handler], bool]) -> None:
        """Replace the handlers of `numbers` for which `is_replaced(number, handler)` is true.

        Outside the main thread none is replaced, because signals arrive in the main thread only.
        """
        if threading.current_thread() is not threading.main_thread():
            return
        numbers = set(numbers)
        self._mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        try:
            self._is_active = True
            signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
            for number in numbers:
                handler = signal.getsignal(number)
                if handler is not None and is_replaced(number, handler):  # None: a handler that is not of Python
                    self._handlers[number] = handler
                    signal.signal(number, self._act)
            signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
        except BaseException:  # of a handler that was not replaced yet, or of one that another thread has taken
            self._is_active = False
            signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
            raise

    def restore(self) -> None:
        """Give the signals back to the program's own handlers. A handler that was set meanwhile stays."""
        if not self._is_active:
            return
        try:
            self._mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())  # a handler may have changed it
            signal.pthread_sigmask(signal.SIG_BLOCK, self._handlers)
            self._is_active = False
            for number, handler in self._handlers.items():
                if signal.getsignal(number) == self._act:
                    signal.signal(number, handler)
        finally:
            self._is_active = False
            signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)

    def _act(self, number: int, frame: FrameType | None) -> None:
        handler = self._handlers[number]
        if self._is_active:
            self._handle(number, frame, handler)
        else:
            signal.signal(number, handler)
            signal.raise_signal(number)


class HeldSignals:
    """A context manager that counts `SIGNALS` instead of obeying them.

    `received` lists the signals of an earlier block (`before`), then the signals that arrived in the `with` block.
    The `ABORTS_AT`-th signal ends the block with AbortedError. At the end of the block, the program's own handler is
    called for this signal, and may raise another error instead. The caller decides about the earlier signals. Ignored
    signals stay ignored. Outside the main thread no signal is held.
    """

    def __init__(self, before: Sequence[signal.Signals] = ()) -> None:
        self.received = [*before]
        self._handlers = ReplacedHandlers(self._count)
        self._may_abort = False

    @property
    def aborted(self) -> bool:
        """True if `ABORTS_AT` signals arrived, which ended the block."""
        return len(self.received) >= ABORTS_AT

    def __enter__(self) -> Self:
        """Hold the signals from now on."""
        self._handlers.replace(SIGNALS, lambda _number, handler: handler != signal.SIG_IGN)
        self._may_abort = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signals back to the program's own handlers."""
        self._may_abort = False
        self._handlers.restore()
        if isinstance(error, AbortedError):
            signal.raise_signal(self.received[-1])

    def _count(self, number: int, _frame: FrameType | None, _handler: Handler) -> None:
        self.received.append(signal.Signals(number))
        if self._may_abort and self.aborted:
            self._may_abort = False
            raise AbortedError(f"{ABORTS_AT} signals")
