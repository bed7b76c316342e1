"""Spelling suggestions for an unknown name: the most similar known name, or the list of all known names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

NO_TEXT = "is not a text file (UTF-8)"
NO_TEXT_CURE = "check that it is the file you mean, and save it as plain text in UTF-8"
"""What an error says about a file that is not text, and the cure."""


NEAR = 0.6
"""Least similarity of a suggested name: 2 · common letters / all letters of both names, as `difflib` counts them."""


def nearest_name(name: str, names: Iterable[str]) -> str | None:
    """Return that one of `names` with the spelling most similar to `name`; None if no name is similar."""
    return next(iter(difflib.get_close_matches(name, sorted(names), n=1, cutoff=NEAR)), None)


def suggestion(name: str, names: Iterable[str]) -> str:
    """Return the question `did you mean 'x'?`, x being the name most similar to `name`; "" if no name is similar."""
    near = nearest_name(name, names)
    return "" if near is None else f"did you mean '{near}'?"


def suggestion_or_list(name: str, names: Iterable[str]) -> str:
    """Return the suggestion, or else `known are: x, y` with all `names`."""
    in_order = sorted(names)
    return suggestion(name, in_order) or f"known are: {', '.join(in_order)}"


def suggested_file(path: Path) -> str:
    """Return `did you mean 'x'?`; x is the file with the most similar name in the same folder.

    Files with the same ending are compared by their names without it, and those with the same name by their endings.
    The result is "" if neither is similar.
    """
    others: list[Path] = []
    with suppress(OSError, ValueError):
        others = list(path.parent.iterdir())
    stem = nearest_name(path.stem, [one.stem for one in others if one.suffix == path.suffix])
    ending = nearest_name(path.suffix, [one.suffix for one in others if one.stem == path.stem])
    if stem is None and ending is None:
        return ""
    return f"did you mean '{path.with_name((stem or path.stem) + (path.suffix if stem else ending or ''))}'?"


def missing_file_cure(path: Path) -> str:
    """Return the cure for a missing file: the suggested file, or else the advice to check the path."""
    return suggested_file(path) or "check the path"
