"""Switching the heater off at the end of a run, and the outcome as a typed result.

Every way out of a run (its end, a trip, an exception of any type, a signal) leads through `ends_safe`. No exception and
no signal keeps the safe state from being written, and none hides how that ended: `ShutdownOutcome` says whether
read-back confirmed the heater off. The error that ended the run carries the outcome; `shutdown_of` returns it.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from smadrive.errors import CUT, UNCONFIRMED
from smadrive.interrupts import ABORTS_AT, HeldSignals

CONFIRMED = "the heater is off, confirmed by read-back"

_CARRIED_AS = "shutdown"
"""The attribute of an error that holds the outcome."""


@dataclass(frozen=True, slots=True)
class ShutdownOutcome:
    """How switching off ended: `failure` is None when read-back confirmed the heater off.

    `signals` arrived meanwhile and were not obeyed, unless there were so many that they ended the tries (`aborted`).
    `ended_run`: a run that may have heated ended so; the user is told of a confirmed outcome, too.
    """

    failure: BaseException | None = None
    signals: tuple[signal.Signals, ...] = ()
    ended_run: bool = False

    @property
    def confirmed(self) -> bool:
        """Whether read-back confirmed the heater off."""
        return self.failure is None

    @property
    def aborted(self) -> bool:
        """Whether the user ended the tries."""
        return not self.confirmed and len(self.signals) >= ABORTS_AT

    def __str__(self) -> str:
        """One sentence for the user."""
        if self.confirmed:
            return CONFIRMED
        reason = f"given up after {len(self.signals)} signals" if self.aborted else self.failure
        return f"{UNCONFIRMED} ({reason}): {CUT}"

    def obey_signals(self) -> None:
        """Give the first signal to the program's own handler, which may raise."""
        if self.signals:
            signal.raise_signal(self.signals[0])


NOT_TRIED = ShutdownOutcome(RuntimeError("switching off was not tried"))


def shut_down(
    enter_safe_state: Callable[[], object], before: ShutdownOutcome = NOT_TRIED, *, is_run: bool = False
) -> ShutdownOutcome:
    """Switch off by `enter_safe_state`; whatever it raises becomes the outcome. Signals are held meanwhile.

    `before` is the outcome of an earlier try, whose signals count too.
    """
    held = HeldSignals(before.signals)
    failure: BaseException | None = None
    try:
        with held:
            enter_safe_state()
    except BaseException as error:  # noqa: BLE001  (the caller decides what is raised; nothing may hide the outcome)
        failure = error
    return ShutdownOutcome(failure, tuple(held.received), is_run or before.ended_run)


def carry(error: BaseException, outcome: ShutdownOutcome) -> None:
    """Have `error` carry the outcome of the latest try. Its traceback shows an unconfirmed one as a note."""
    before = shutdown_of(error)
    if before is not None and not before.confirmed:
        error.__notes__ = [note for note in getattr(error, "__notes__", ()) if note != _note(error, before)]
    setattr(error, _CARRIED_AS, outcome)
    if not outcome.confirmed:
        error.add_note(_note(error, outcome))


def shutdown_of(error: BaseException) -> ShutdownOutcome | None:
    """The outcome that `error` carries; None when nothing was switched off because of it."""
    outcome: ShutdownOutcome | None = getattr(error, _CARRIED_AS, None)
    return outcome


@contextmanager
def ends_safe(enter_safe_state: Callable[[], object], *, is_run: bool = False) -> Iterator[None]:
    """Switch the heater off by `enter_safe_state` when the block, perhaps a run that heats, ends, whatever ends it.

    The error that ended the block carries the outcome and is raised again; signals that arrived meanwhile do not take
    its place. Without an error, the failure to switch off is raised, or else a signal that arrived meanwhile is obeyed.
    A user who has aborted the switching off is not made to wait for another try.
    """
    try:
        yield
    except BaseException as error:
        before = shutdown_of(error) or NOT_TRIED
        if not before.aborted:
            carry(error, shut_down(enter_safe_state, before, is_run=is_run))
        raise
    outcome = shut_down(enter_safe_state, is_run=is_run)
    if outcome.failure is not None:
        carry(outcome.failure, outcome)
        raise outcome.failure
    try:
        outcome.obey_signals()
    except BaseException as error:
        carry(error, outcome)
        raise


def _note(error: BaseException, outcome: ShutdownOutcome) -> str:
    """The sentence of an unconfirmed outcome, without what `error` itself says."""
    return f"{UNCONFIRMED}: {CUT}" if outcome.failure is error and not outcome.aborted else str(outcome)
