"""The command line: one file per command, and here how they are gathered and how they end.

Every error of smadrive becomes one line on stderr and its exit code: 2 usage or config, 3 communication or device,
4 safety trip, 5 identification. Ctrl-C, SIGTERM and a terminal that is closed unwind the program, so the heater is at
zero before it ends; signals that come while it is switched off do not interrupt that (see interrupts.py). Whatever
ended a run, the last lines say whether it tripped and whether the heater is confirmed off.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from contextlib import suppress
from importlib.metadata import version
from types import FrameType
from typing import Annotated

import typer

from smadrive.cli.stdout import open_stdout
from smadrive.errors import SmadriveError, TripError
from smadrive.interrupts import SIGNALS
from smadrive.onethread import ONE_THREAD
from smadrive.shutdown import ShutdownOutcome, shutdown_of

INTERRUPTED = 130

COMMANDS = {
    "demo": "A simulated wire, identified and driven: the whole product at work, with a report.",
    "scan": "Find the devices on a line, and the profiles that match them.",
    "probe": "Connect to a rig, check who is there, show live values.",
    "excite": "Run the identification experiment on a rig.",
    "identify": "Fit a hysteresis model to recorded data.",
    "simulate": "Run a model along the input path in a file.",
    "invert": "Find the input path for the outputs in a file.",
    "run": "Track a displacement reference on a rig.",
    "tune": "Open the live tuning page of a rig.",
    "report": "Show a log as one page: plots, figures, faults, provenance; or as CSV.",
    "replay": "Run model and controller once more on what was recorded.",
    "paper": "Redo the simulation of the published T-S fuzzy Duhem model, with its figures.",
    "off": "Put every device of a rig into its safe state, confirmed.",
}


def main() -> None:
    """Entry point of the command `smadrive`."""
    os.environ |= {**ONE_THREAD, **os.environ}
    open_stdout()
    interrupt = _Interrupt()
    for number in SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup: go on without a terminal
            signal.signal(number, interrupt)
    try:
        _app(wanted=next(iter(sys.argv[1:]), ""))()
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


def _tell_version(wanted: bool) -> None:
    if wanted:
        print(f"smadrive {version('smadrive')}")
        raise typer.Exit


def _app(wanted: str) -> typer.Typer:
    """All commands by name, with only the wanted one imported: help in no time, and no plots for a probe."""
    app = typer.Typer(
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        help="The driver that makes a shape-memory-alloy wire move where it is told.",
    )
    app.callback()(_options)
    for name, summary in COMMANDS.items():
        if name == wanted:
            app.command(name)(importlib.import_module(f"smadrive.cli.{name}").main)
        else:
            app.command(name, help=summary)(_not_imported)
    return app


def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_tell_version, help="Tell the version.")
    ] = False,
) -> None:
    """What stands before a command."""


def _not_imported() -> None:
    """Stands in the list for a command that was not asked for."""


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
