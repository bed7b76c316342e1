"""The command line: one file per command, and here how they are gathered and how they end.

Every error of smadrive becomes one line on stderr and its exit code: 2 usage or config, 3 communication or device,
4 safety trip, 5 identification. Ctrl-C and SIGTERM unwind the program, so the heater is at zero before it ends; a
second Ctrl-C does not interrupt the switching off.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

import click
import typer
from typer.core import TyperGroup

from smadrive.cli import demo, excite, identify, invert, off, probe, run, simulate
from smadrive.errors import SmadriveError

INTERRUPTED = 130


class PlainGroup(TyperGroup):
    """Commands whose errors are sentences, not tracebacks."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; turn its errors into one line and an exit code."""
        try:
            return super().invoke(ctx)
        except SmadriveError as error:
            print(f"smadrive: {error}", file=sys.stderr)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            print("smadrive: interrupted; the heater is off", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    cls=PlainGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="The driver that makes a shape-memory-alloy wire move where it is told.",
)
for command in (demo, probe, excite, identify, simulate, invert, run, off):
    app.command(command.__name__.rpartition(".")[2])(command.main)


def _interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
    """Unwind once; what comes after that must not interrupt the way to zero current."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def main() -> None:
    """Entry point of the command `smadrive`."""
    signal.signal(signal.SIGINT, _interrupt)
    signal.signal(signal.SIGTERM, _interrupt)
    app()
