"""Parsing of numbers as people and files write them.

Python's own `float` and `int` also accept `2_0` and the digits of every script, and take minutes for a million digits.
"""

from __future__ import annotations

import re

MOST_DIGITS = 400
"""Characters of a number: more than the longest float needs."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf)", re.ASCII)
_WHOLE = re.compile(r"[+-]?(?:0[xX][0-9a-fA-F]+|[0-9]+)", re.ASCII)


def parse_number(text: str) -> float:
    """The number in `text`; the caller rejects NaN and infinity. ValueError when the text is not a number."""
    return float(_checked(text, _NUMBER))


def parse_whole(text: str) -> int:
    """The whole number in `text`, decimal or as 0x8000. ValueError when the text is not one."""
    digits = _checked(text, _WHOLE)
    return int(digits, 16 if "x" in digits.lower() else 10)


def _checked(text: str, form: re.Pattern[str]) -> str:
    trimmed = text.strip(" \t")
    if len(trimmed) > MOST_DIGITS or form.fullmatch(trimmed) is None:
        raise ValueError(f"{shortened(text)} is not a number")
    return trimmed


def shortened(value: object, most: int = 60) -> str:
    """The `repr` of a value, cut to `most` characters for a message."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits
        text = f"a {type(value).__name__} of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 3]}..."
