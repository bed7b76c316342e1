"""Spelling suggestions for an unknown name: the nearest known name, or the list of all names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def suggestion(name: str, names: Iterable[str]) -> str:
    """Return the question `did you mean 'x'?`, x being the name nearest to `name`; "" if no name is near."""
    close = difflib.get_close_matches(name, sorted(names), n=1)
    return f"did you mean '{close[0]}'?" if close else ""


def suggestion_or_list(name: str, names: Iterable[str]) -> str:
    """Return the suggestion, or else `known are: x, y` with all `names`."""
    in_order = sorted(names)
    return suggestion(name, in_order) or f"known are: {', '.join(in_order)}"
