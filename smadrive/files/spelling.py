"""Spelling suggestions for an unknown name: the nearest known one, or the list of all."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def suggestion(name: str, known: Iterable[str]) -> str:
    """The question `did you mean 'x'?` for the known name nearest to `name`; empty when none is near."""
    close = difflib.get_close_matches(name, sorted(known), n=1)
    return f"did you mean '{close[0]}'?" if close else ""


def suggestion_or_list(name: str, known: Iterable[str]) -> str:
    """The suggestion, or else `known are: x, y` with all known names."""
    names = sorted(known)
    return suggestion(name, names) or f"known are: {', '.join(names)}"
