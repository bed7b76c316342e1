"""Output of the commands: text and tables for a person, one JSON object for a program.

rich is imported only for a table or a progress bar: `off` needs neither, and must start at once.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smadrive.cli.terminal.stdout import encodable
from smadrive.errors import DataError

if TYPE_CHECKING:
    from rich.progress import Progress

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else on stdout.")]


class Output:
    """Prints results to stdout, and progress to stderr if stderr is a terminal. If `quiet`, it prints only JSON."""

    def __init__(self, as_json: bool) -> None:
        self.quiet = as_json

    def say(self, text: str) -> None:
        """Print one line for a person."""
        if not self.quiet:
            print(text)

    def report(self, text: str) -> None:
        """Print one line for a person. With `--json` it goes to stderr, because stdout is for the JSON object."""
        print(text, file=sys.stderr if self.quiet else sys.stdout)

    def warn(self, caveats: Iterable[str]) -> None:
        """Print each reason to distrust the results on a line of its own."""
        for caveat in caveats:
            self.say(f"warning: {caveat}")

    def table(self, header: Sequence[str], rows: Iterable[Sequence[str]], *, notes: bool = False) -> None:
        """Print a table, or nothing with `--json`: names in the first column, numbers in the others.

        With `notes`, the last column holds text, too. If the terminal is too narrow for the numbers, the table becomes
        a list.
        """
        if self.quiet:
            return
        from rich.console import Console  # noqa: PLC0415

        from smadrive.cli.terminal.table import fitted_table, list_lines  # noqa: PLC0415

        console, shown = Console(highlight=False, markup=False), [[*map(encodable, row)] for row in rows]
        texts = {0, len(header) - 1} if notes else {0}
        table = fitted_table(header, shown, texts, console.width)
        if table is not None:
            console.print(table)
        else:
            print(*list_lines(header, shown), sep="\n")

    def result(self, values: Mapping[str, Any]) -> None:
        """With `--json`, print this JSON object. JSON has no NaN, so NaN and infinity become null."""
        if self.quiet:
            json.dump(_without_nan(values), sys.stdout, indent=2, allow_nan=False)
            print()

    def json_line(self, values: Mapping[str, Any]) -> None:
        """With `--json`, print this JSON object in one line. NaN and infinity become null."""
        if self.quiet:
            print(json.dumps(_without_nan(values), allow_nan=False))

    def progress(self, title: str) -> Progress:
        """Return a progress display with one task of unknown length. The display is a context manager.

        The display vanishes at the end of the context.
        """
        from rich.console import Console  # noqa: PLC0415
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn  # noqa: PLC0415

        console = Console(stderr=True)
        columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn()
        progress = Progress(*columns, console=console, transient=True, disable=self.quiet or not console.is_terminal)
        progress.add_task(title, total=None)
        return progress


def _without_nan(value: Any) -> Any:
    match value:
        case float():
            return value if isfinite(value) else None
        case Mapping():
            return {name: _without_nan(inner) for name, inner in value.items()}
        case list() | tuple():
            return [_without_nan(inner) for inner in value]
    return value


def make_empty_folder(folder: Path) -> Path:
    """Make the folder, if it is missing, and return it. DataError when it cannot be made, or is not empty."""
    make_folder(folder)
    if any(folder.iterdir()):
        raise DataError("the folder is not empty", where=folder, cure="choose another --output-dir")
    return folder


def make_folder(folder: Path) -> None:
    """Make the output folder of a command, with its parents. DataError when it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(
            "the folder cannot be made", where=folder, value=error.strerror, cure="choose another --output-dir"
        ) from None
