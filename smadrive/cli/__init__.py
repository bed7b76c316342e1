"""The command line: one file per command, packages of shared code, and the entry point with exit codes and signals.

It may import everything below it. Logic that scripts also need belongs to rig, runs or tuning, not here.

Every error of smadrive becomes a message on stderr and an exit code: 2 usage or config, 3 communication or device,
4 safety, 5 identification (see errors.py). The exit code of an interruption is 130, or 4 if a trip was already ending
the run. Ctrl-C is the normal end of `watch`, with exit code 0. Ctrl-C, SIGTERM and a closed terminal unwind the
program, so the heater is off before the program ends; later signals do not disturb this. Signals that arrive while the
heater is switched off are held back (see interrupts.py). The last lines say whether a run tripped and whether the
heater is confirmed off.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

from smadrive.cli.terminal.stdout import open_stdout
from smadrive.errors import SmadriveError, StoppedError, TripError
from smadrive.interrupts import SIGNALS, unblock_signals
from smadrive.numerics.blas_threads import ONE_THREAD
from smadrive.safety.shutdown import ShutdownOutcome, shutdown_of

INTERRUPTED = 130


def main() -> None:
    """Entry point of the command `smadrive`."""
    os.environ |= {**ONE_THREAD, **os.environ}
    open_stdout()
    for number in SIGNALS:
        if number.name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN:  # with nohup, SIGHUP stays ignored
            signal.signal(number, _interrupt)
    unblock_signals()
    try:
        from smadrive.cli.parsing.app import (  # noqa: PLC0415 (a signal during this import is handled, too)
            command_line,
            typed_command,
        )

        command_line(typed_command(sys.argv[1:], os.environ))()
    except StoppedError as stopped:
        _print_end(stopped, *_endings(stopped, str(stopped)))
        sys.exit(stopped.exit_code)
    except SmadriveError as error:
        _print_end(error, str(error))
        sys.exit(error.exit_code)
    except SystemExit as ended:
        if ended.code != INTERRUPTED:
            raise
        for number in SIGNALS:  # the command has ended: a later signal could only disturb its last lines
            signal.signal(number, signal.SIG_IGN)
        _print_end(ended, *_endings(ended, "interrupted"))
        trip = _trip_before(ended)
        if trip is None:
            raise
        sys.exit(trip.exit_code)


def _endings(interruption: BaseException, ending: str) -> tuple[str, ...]:
    """Return the lines that say how the run ended: first the trip, if there was one, then the interruption."""
    trip = _trip_before(interruption)
    return (ending,) if trip is None else (str(trip), f"then {ending}")


def _trip_before(interruption: BaseException) -> TripError | None:
    """Return the trip that was already ending the run when the interruption came, or None."""
    error: BaseException | None = interruption
    while error is not None and not isinstance(error, TripError):
        error = error.__context__
    return error


def _is_printed(outcome: ShutdownOutcome, error: BaseException) -> bool:
    """Return True if a confirmed shutdown is printed: after a run, an interruption, or a stop by `smadrive off`."""
    return outcome.ended_run or isinstance(error, SystemExit | StoppedError)


def _print_end(error: BaseException, *ending: str) -> None:
    """Print `ending`, the notes of `error` and the outcome of the shutdown, one line each.

    A failed write to stderr does not change the exit code.
    """
    outcome = shutdown_of(error)
    confirmed = (str(outcome),) if outcome is not None and outcome.confirmed and _is_printed(outcome, error) else ()
    with suppress(OSError, ValueError):
        lines = (*ending, *getattr(error, "__notes__", ()), *confirmed)
        print(*(f"smadrive: {line}" for line in lines), sep="\n", file=sys.stderr)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """The handler of `SIGNALS`. Raise SystemExit, unless an earlier signal is unwinding the program.

    An earlier signal alone is no reason to ignore a later one: Python swallows an exception that is raised in a
    finalizer or in the lock of an import, and the program goes on.

    The handler prints nothing, because a stalled terminal must not keep the heater on.
    """
    if not _is_unwinding():
        raise SystemExit(INTERRUPTED)


def _is_unwinding() -> bool:
    """Return True if an exception that is handled now, or one of its contexts, is the SystemExit of `_interrupt`."""
    seen: set[int] = set()  # contexts may form a circle
    error = sys.exception()
    while error is not None and id(error) not in seen:
        if isinstance(error, SystemExit) and error.code == INTERRUPTED:
            return True
        seen.add(id(error))
        error = error.__context__
    return False
