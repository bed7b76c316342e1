"""Interruptions of a request: how the script counts them, and when they act in the loop process.

During a request, nothing is raised in the script: Ctrl-C, and an interruption of the kernel of a notebook, are counted
and passed on. An exception that another signal handler of the script raises is kept, and passed on as an interruption.
In the loop process a signal acts as its phase says:

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
from enum import Enum, auto
from types import FrameType, TracebackType
from typing import Any, Self

from smadrive.interrupts import Handler, ReplacedHandlers
from smadrive.safety.shutdown import carry, shutdown_of
from smadrive.scripting.loop.messages import Failure, Result


class Phase(Enum):
    """A phase of the main thread, as in the table at the head of this file."""

    WAITING = auto()
    RESTORING = auto()
    CARRYING_OUT = auto()
    OWN_CODE = auto()


INTERRUPTIBLE = frozenset({Phase.RESTORING, Phase.CARRYING_OUT, Phase.OWN_CODE})
AT_ONCE = frozenset({Phase.WAITING, Phase.RESTORING, Phase.OWN_CODE})
"""The phases in which a signal acts at once. In the other one it acts at the next tick."""

ENDED_BEFORE = "the request was done before the interruption, and no current flows"
"""The message of a KeyboardInterrupt that came too late to interrupt a request. Every request ends at zero current."""


class RequestSignals:
    """A context manager in which no signal handler of the script cuts the wait for a reply.

    SIGINT is counted in `count`. Every other handler is called as usual, but the exception that it raises is kept in
    `error`, to be raised after the request has ended. `passed_on` is the number of interruptions that were sent to the
    loop process for the request `number`. An ignored SIGINT stays ignored. Outside the main thread nothing changes.
    """

    def __init__(self) -> None:
        self.count, self.passed_on, self.number = 0, 0, 0
        self.error: BaseException | None = None
        self._handlers = ReplacedHandlers(self._handle)

    @property
    def interruptions(self) -> int:
        """The number of interruptions to send to the loop process: one per SIGINT, and at least one for an error."""
        return max(self.count, 0 if self.error is None else 1)

    def keep(self, error: BaseException) -> None:
        """Keep an error. The first one stays, but an error that is no Exception, such as SystemExit, replaces it."""
        if self.error is None or (isinstance(self.error, Exception) and not isinstance(error, Exception)):
            self.error = error

    def __enter__(self) -> Self:
        """Count and keep from now on."""
        self._handlers.replace(signal.valid_signals(), _may_raise)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the signals back to the handlers of the script."""
        self._handlers.restore()

    def _handle(self, number: int, frame: FrameType | None, handler: Any) -> None:
        if number == signal.SIGINT:
            self.count += 1
            return
        try:
            handler(number, frame)
        except BaseException as error:  # noqa: BLE001 (raised after the request has ended)
            self.keep(error)


def _may_raise(number: int, handler: Handler) -> bool:
    """Return True if the handler may raise in the script, or if it is the default one of SIGINT, which ends it."""
    return callable(handler) or (number == signal.SIGINT and handler == signal.SIG_DFL)


def error_to_raise(reply: Result | Failure, signals: RequestSignals) -> BaseException | None:
    """Return the error that a request raises in the script after its reply; None if it raises nothing.

    An error of the script comes first, with the outcome of the shutdown. If the request has failed by itself, this
    error gets the failure as a note. An interruption comes before an error that is an Exception: a script that tries
    again after errors must not heat again. The message of a KeyboardInterrupt says that the heater is off, if this is
    confirmed.
    """
    failed = reply.error if isinstance(reply, Failure) else None
    outcome = None if failed is None else shutdown_of(failed)
    if isinstance(failed, KeyboardInterrupt) and outcome is not None and outcome.confirmed:
        failed.args = (str(outcome),)
    error = failed if signals.error is None else signals.error
    if signals.count and (error is None or isinstance(error, Exception)):
        error = KeyboardInterrupt(ENDED_BEFORE if failed is None else str(outcome or failed))
        error.__cause__ = signals.error
    if error is None or error is failed:
        return error
    if outcome is not None:
        carry(error, outcome)
    if failed is not None and not isinstance(failed, KeyboardInterrupt):
        error.add_note(str(failed))
    return error
