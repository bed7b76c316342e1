"""The keys that end a command on a terminal: q and Ctrl-C."""

from __future__ import annotations

import os
import select
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from smadrive.posix import termios, tty

END_KEYS = b"qQ"


@contextmanager
def end_key() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns True if q was pressed since its last call. It never waits.

    During the `with` block, the terminal passes each key on at once and does not show it; Ctrl-C keeps its effect.
    Without a terminal, the function always returns False.
    """
    terminal = _own_terminal()
    if terminal is None:
        yield lambda: False
        return
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal, termios.TCSANOW)
    try:
        yield lambda: _is_pressed(terminal)
    finally:
        with suppress(OSError, termios.error):
            termios.tcsetattr(terminal, termios.TCSANOW, before)


@contextmanager
def end_interrupt() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns True after the first Ctrl-C. The second Ctrl-C interrupts the command."""
    before = signal.getsignal(signal.SIGINT)
    received: list[int] = []

    def receive(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, receive)
    try:
        yield lambda: bool(received)
    finally:
        signal.signal(signal.SIGINT, before)


def _own_terminal() -> int | None:
    """Return the descriptor of the terminal at standard input; None without a terminal, and for a background job."""
    try:
        descriptor = sys.stdin.fileno()
        is_own = os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp()
    except (AttributeError, OSError, ValueError):
        return None
    return descriptor if is_own else None


def _is_pressed(terminal: int) -> bool:
    try:
        if not select.select([terminal], [], [], 0)[0]:
            return False
        return any(key in END_KEYS for key in os.read(terminal, 64))
    except OSError:
        return False
