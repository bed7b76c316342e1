"""Switching the heater off at the end of a run, and the outcome as a typed result.

Every run is a `with` block of `ends_safe`. The block switches the heater off at the end of the run, and after a trip,
an exception of any type or a signal. The `ABORTS_AT`-th signal ends the tries early. No earlier signal and no exception
prevents the writing of the safe state or hides its outcome. `ShutdownOutcome` tells if read-back confirmed the heater
off. The error that ended the run carries this outcome; `shutdown_of` returns it.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from smadrive.errors import ConfigError, StoppedError
from smadrive.interrupts import ABORTS_AT, HeldSignals

CONFIRMED = "the heater is off, confirmed by read-back"

UNCONFIRMED = "the heater could NOT be confirmed off"
"""If current may still flow, an error carries a note that begins with this text."""

_CUT = "cut its supply"
_CURE = (
    f"{_CUT} by hand. Is the device, or its simulator, stopped or slow? When it answers again, confirm with "
    "`smadrive off RIG` that the heater is off"
)
_CURE_FOR_CONFIG = f"correct the command or the file and run `smadrive off RIG`, or {_CUT} by hand"
"""The cure when no device was asked."""

_CARRIED_AS = "shutdown"
"""The name of the attribute of an error that holds its ShutdownOutcome."""


@dataclass(frozen=True, slots=True)
class ShutdownOutcome:
    """The outcome of switching off.

    failure     the error of the last try; None when read-back confirmed the heater off
    signals     the signals that arrived during the switching off, in order; the `ABORTS_AT`-th ends the tries
    ended_run   True after a run that may have heated; the user then reads the outcome even if it is confirmed
    """

    failure: BaseException | None = None
    signals: tuple[signal.Signals, ...] = ()
    ended_run: bool = False

    @property
    def confirmed(self) -> bool:
        """True if read-back confirmed the heater off."""
        return self.failure is None

    @property
    def aborted(self) -> bool:
        """True if the tries ended unconfirmed because `ABORTS_AT` signals arrived."""
        return not self.confirmed and len(self.signals) >= ABORTS_AT

    def __str__(self) -> str:
        """One sentence for the user."""
        if self.confirmed:
            return CONFIRMED
        reason = f"given up after {len(self.signals)} signals" if self.aborted else self.failure
        return f"{UNCONFIRMED} ({reason}): {_CURE}"

    def obey_signals(self) -> None:
        """Call the program's own handler for the first signal in `signals`; the handler may raise an error."""
        if self.signals:
            signal.raise_signal(self.signals[0])


def off_text(*, confirmed: bool) -> str:
    """Return the text of events and displays after a try to switch off. It is shorter than that of ShutdownOutcome."""
    return "heater off, confirmed" if confirmed else f"{UNCONFIRMED}: {_CUT}"


NOT_TRIED = ShutdownOutcome(RuntimeError("switching off was not tried"))


def shut_down(
    enter_safe_state: Callable[[], object], before: ShutdownOutcome = NOT_TRIED, *, is_run: bool = False
) -> ShutdownOutcome:
    """Switch off by `enter_safe_state`, with signals held back. Return the outcome; an error becomes its `failure`.

    `before` is the outcome of an earlier try, whose signals count too. `is_run` is True for a run that may have heated.
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
    """Attach the outcome of the latest try to `error`, and a note if this outcome does not confirm the heater off."""
    before = shutdown_of(error)
    if before is not None and not before.confirmed:
        error.__notes__ = [note for note in getattr(error, "__notes__", ()) if note != _note(error, before)]
    setattr(error, _CARRIED_AS, outcome)
    if not outcome.confirmed:
        error.add_note(_note(error, outcome))


def shutdown_of(error: BaseException) -> ShutdownOutcome | None:
    """Return the outcome that `error` carries, or None if it carries no outcome.

    A StoppedError without an outcome has the outcome of its cause, the error or the interruption that ended the run.
    """
    outcome: ShutdownOutcome | None = getattr(error, _CARRIED_AS, None)
    if outcome is None and isinstance(error, StoppedError) and error.__cause__ is not None:
        return shutdown_of(error.__cause__)
    return outcome


def keep_outcome(error: BaseException) -> None:
    """Attach to `error` the outcome that its cause carries, because a pickled error loses its cause."""
    if (outcome := shutdown_of(error)) is not None:
        setattr(error, _CARRIED_AS, outcome)


@contextmanager
def ends_safe(enter_safe_state: Callable[[], object], *, is_run: bool = False) -> Iterator[None]:
    """Switch the heater off by `enter_safe_state` at the end of the `with` block, even after an error or a signal.

    `is_run` is True for a block that may heat. An error that ended the block carries the outcome and is raised again;
    signals that arrived during the switching off do not replace this error. After a block without an error, a failure
    to switch off is raised; without a failure, a signal that arrived is obeyed. If the user aborted a try within the
    block, no second try follows.
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
    """Return the note for an unconfirmed outcome. If `error` is the failure itself, the note omits its message."""
    if outcome.failure is not error or outcome.aborted:
        return str(outcome)
    return f"{UNCONFIRMED}: {_CURE_FOR_CONFIG if isinstance(error, ConfigError) else _CURE}"
