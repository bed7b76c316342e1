"""The turns of the threads of a script: one request is carried out at a time.

A thread that switches off ends the long request of another thread, and lets none begin that has waited. The other one
may hang in the display of its progress, so the thread that switches off sends the interruption.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from smadrive.errors import ConfigError, SafetyError
from smadrive.interrupts import signals_obeyed_afterwards
from smadrive.scripting.callbacks import check_may_wait
from smadrive.scripting.loop.messages import LongRequest


class Turns:
    """Gives one thread at a time its turn. `end_request` interrupts the long request of the present turn."""

    def __init__(self, end_request: Callable[[BaseException], None]) -> None:
        self._end_request = end_request
        self._one_turn, self._one_count = threading.Lock(), threading.Lock()
        self._begun_offs, self._active_offs, self._offs_before = 0, 0, 0
        self._in_turn = threading.local()  # a signal handler runs in the thread that it interrupts

    @property
    def is_taken(self) -> bool:
        """True during the turn of a thread."""
        return self._one_turn.locked()

    @property
    def is_switching_off(self) -> bool:
        """True while a thread switches off, or waits for its turn to do so."""
        return self._active_offs > 0

    @property
    def is_ended(self) -> bool:
        """True if a thread switched off when the thread of the present turn began to wait for it, or since then."""
        return self._begun_offs != self._offs_before

    def check_may_wait(self) -> None:
        """Raise an error if this thread must not wait for a turn now.

        MotionError in a callback of a servo (see callbacks.py). ConfigError in a signal handler during a turn.
        """
        check_may_wait("loop process")
        if getattr(self._in_turn, "is_active", False):
            what, cure = "a signal handler must not use the rig during a request", "raise an exception in the handler"
            raise ConfigError(what, where="loop process", cure=cure)

    @contextmanager
    def turn(self, request: Any) -> Iterator[None]:
        """Wait for the turn of this thread, in which it carries out `request`.

        SafetyError if another thread switches off: a long request that waits behind this must not heat the wire again.
        """
        self.check_may_wait()
        try:
            self._in_turn.is_active = True  # before the lock: a handler that waited for it would wait for ever
            offs_before = self._begun_offs - self._active_offs
            with self._one_turn:
                self._offs_before = offs_before
                if isinstance(request, LongRequest) and self.is_ended:
                    raise ended_by_thread()
                yield
        finally:
            self._in_turn.is_active = False

    @contextmanager
    def others_ended(self, end_servo: Callable[[], None]) -> Iterator[None]:
        """End the long request of the present turn, and let none begin until the end of the `with` block.

        The request of a servo ends by its own command, which `end_servo` sends. An interruption is raised after that.
        """
        is_counted = False
        try:
            with signals_obeyed_afterwards():
                with self._one_count:
                    self._begun_offs, self._active_offs, is_counted = self._begun_offs + 1, self._active_offs + 1, True
                self._end_request(ended_by_thread())
                end_servo()
            yield
        finally:
            if is_counted:
                with signals_obeyed_afterwards(), self._one_count:
                    self._active_offs -= 1


def ended_by_thread() -> SafetyError:
    """Return the error of a request that a thread has ended by switching off."""
    what, cure = "ended by off() or close()", "run the wire again if this was not meant"
    return SafetyError(what, where="loop process", cure=cure)
