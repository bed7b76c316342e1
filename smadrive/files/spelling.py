"""Spelling suggestions for an unknown name: the nearest known name, or the list of all names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

NO_TEXT = "is not a text file (UTF-8)"
NO_TEXT_CURE = "check that it is the file you mean, and save it as plain text in UTF-8"
"""The error of a file with bytes that are no text, and its cure."""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Return the question `did you mean 'x'?`, x being the name nearest to `name`; "" if no name is near."""
    close = difflib.get_close_matches(name, sorted(names), n=1)
    return f"did you mean '{close[0]}'?" if close else ""


def suggestion_or_list(name: str, names: Iterable[str]) -> str:
    """Return the suggestion, or else `known are: x, y` with all `names`."""
    in_order = sorted(names)
    return suggestion(name, in_order) or f"known are: {', '.join(in_order)}"


def suggested_file(path: Path) -> str:
    """Return `did you mean 'x'?`; x is the file of the same folder and ending with the nearest name.

    The result is "" if no name is near.
    """
    names: list[str] = []
    with suppress(OSError, ValueError):
        names = sorted(one.name for one in path.parent.iterdir() if one.suffix == path.suffix)
    close = difflib.get_close_matches(path.name, names, n=1)
    return f"did you mean '{path.with_name(close[0])}'?" if close else ""


def missing_file_cure(path: Path) -> str:
    """Return the cure for a missing file: the suggested file, or else the advice to check the path."""
    return suggested_file(path) or "check the path"
