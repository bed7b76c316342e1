"""What to say of a name that nobody knows: the one that was probably meant, or all that there are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def meant(name: str, known: Iterable[str]) -> str:
    """The tail of a message that has named all the `known`: the one nearest to `name`; empty when none is near."""
    close = difflib.get_close_matches(name, sorted(known), n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def nearest(name: str, known: Iterable[str]) -> str:
    """The tail of a message about an unknown `name`: the nearest known one, or all of them."""
    names = sorted(known)
    return meant(name, names) or f"; known are: {', '.join(names)}"
