"""The command line: one file per command, app.py gathers them, and here is how they end.

Every error of smadrive becomes one line on stderr and its exit code: 2 usage or config, 3 communication or device,
4 safety trip, 5 identification. Ctrl-C, SIGTERM and a terminal that is closed unwind the program, so the heater is at
zero before it ends; signals that come while it is switched off do not interrupt that (see interrupts.py). Whatever
ended a run, the last lines say whether it tripped and whether the heater is confirmed off.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

from smadrive.cli.stdout import open_stdout
from smadrive.errors import SmadriveError, TripError
from smadrive.interrupts import SIGNALS
from smadrive.numerics.blas_threads import ONE_THREAD
from smadrive.safety.shutdown import ShutdownOutcome, shutdown_of

INTERRUPTED = 130


def main() -> None:
    """Entry point of the command `smadrive`."""
    os.environ |= {**ONE_THREAD, **os.environ}
    open_stdout()
    interrupt = _Interrupt()
    for number in SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup: go on without a terminal
            signal.signal(number, interrupt)
    try:
        from smadrive.cli.app import command_line  # noqa: PLC0415 (a signal while it is imported is handled, too)

        command_line(wanted=next(iter(sys.argv[1:]), ""))()
    except SmadriveError as error:
        _tell(error, str(error))
        sys.exit(error.exit_code)
    except SystemExit as ended:
        if ended.code != INTERRUPTED:
            raise
        trip = _trip_before(ended)
        if trip is None:
            _tell(ended, "interrupted")
            raise
        _tell(ended, str(trip), "then interrupted")
        sys.exit(trip.exit_code)


def _trip_before(interruption: SystemExit) -> TripError | None:
    """The trip that was ending the run already when the signal came; the signal must not hide it."""
    error: BaseException | None = interruption
    while error is not None and not isinstance(error, TripError):
        error = error.__context__
    return error


def _is_told(outcome: ShutdownOutcome, error: BaseException) -> bool:
    """Whether the user must know that the heater is off: after a run, and after an interruption."""
    return outcome.ended_run or isinstance(error, SystemExit)


def _tell(error: BaseException, *ending: str) -> None:
    """How it ended, and what else `error` carries: a line each. A broken stderr does not change the exit code."""
    outcome = shutdown_of(error)
    confirmed = (str(outcome),) if outcome is not None and outcome.confirmed and _is_told(outcome, error) else ()
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            lines = (*ending, *getattr(error, "__notes__", ()), *confirmed)
            print(*(f"smadrive: {line}" for line in lines), sep="\n", file=sys.stderr)


class _Interrupt:
    """The handler of `SIGNALS`: the first one unwinds the program, later ones must not interrupt that.

    Nothing is printed here: a stalled terminal must not keep the heater on.
    """

    _is_ending = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Raise SystemExit once."""
        if not self._is_ending:
            self._is_ending = True
            raise SystemExit(INTERRUPTED)
