"""What commands print: tables and progress for a person, one JSON object for a program."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from smadrive.errors import DataError

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else on stdout.")]


class Output:
    """Where a command's results go; `quiet`: as JSON alone. Progress goes to stderr, and only to a terminal."""

    def __init__(self, as_json: bool) -> None:
        self.quiet = as_json
        self._console = Console(highlight=False, soft_wrap=True)

    def say(self, text: str) -> None:
        """One line for a person."""
        if not self.quiet:
            self._console.print(text, markup=False)

    def warn(self, caveats: Iterable[str]) -> None:
        """Reasons to distrust what follows, a line each."""
        for caveat in caveats:
            self.say(f"warning: {caveat}")

    def table(self, header: Sequence[str], rows: Iterable[Sequence[str]], *, notes: bool = False) -> None:
        """A table for a person: the first column names, the others are numbers; with `notes` the last is text, too."""
        if self.quiet:
            return
        table = Table(header_style="bold")
        for n, name in enumerate(header):
            table.add_column(name, justify="left" if n == 0 or (notes and n == len(header) - 1) else "right")
        for row in rows:
            table.add_row(*row)
        self._console.print(table)

    def result(self, values: Mapping[str, Any]) -> None:
        """The JSON object for a program; JSON has no NaN: what is not known becomes null."""
        if self.quiet:
            json.dump(_known(values), sys.stdout, indent=2, allow_nan=False)
            print()

    def progress(self) -> Progress:
        """A progress display: a context manager whose `add_task`/`update` draw bars."""
        console = Console(stderr=True)
        return Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            console=console,
            disable=self.quiet or not console.is_terminal,
        )


def _known(value: Any) -> Any:
    match value:
        case float():
            return value if isfinite(value) else None
        case Mapping():
            return {name: _known(inner) for name, inner in value.items()}
        case list() | tuple():
            return [_known(inner) for inner in value]
    return value


def make_empty_folder(folder: Path) -> Path:
    """As `make_folder`; DataError when something is in it, which could be a record."""
    make_folder(folder)
    if any(folder.iterdir()):
        raise DataError(f"{folder}: is not empty, and nothing in it is to be written over: choose another --output-dir")
    return folder


def make_folder(folder: Path) -> None:
    """The folder that a command writes to, with its parents; DataError when it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made ({error.strerror}): choose another --output-dir") from None
