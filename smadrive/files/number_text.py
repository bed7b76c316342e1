"""Parsing of numbers in the usual forms.

Python's own `float` and `int` also accept `2_0`, digits of other scripts and very long texts. The functions here reject
such texts.
"""

from __future__ import annotations

import re

MOST_DIGITS = 400
"""The largest number of characters in the text of a number. No float needs more."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf)", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+", re.ASCII)
_WHOLE = re.compile(r"[+-]?(?:0[xX][0-9a-fA-F]+|[0-9]+)", re.ASCII)


def parse_number(text: str) -> float:
    """Return the number in `text`, which may be `nan` or `inf`. ValueError when the text is not a number."""
    return float(_checked(text, _NUMBER))


def is_number(text: str) -> bool:
    """Return True if `parse_number` can read `text`."""
    try:
        parse_number(text)
    except ValueError:
        return False
    return True


def parse_whole(text: str) -> int:
    """Return the whole number in `text`, which is decimal or hexadecimal (0x8000). ValueError for any other text."""
    digits = _checked(text, _WHOLE)
    return int(digits, 16 if "x" in digits.lower() else 10)


def with_decimal_point(text: str) -> str | None:
    """Return `text` with a decimal point instead of the decimal comma. None for any other text, such as `1.5`."""
    return text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else None


def _checked(text: str, form: re.Pattern[str]) -> str:
    trimmed = text.strip(" \t")
    if len(trimmed) > MOST_DIGITS or form.fullmatch(trimmed) is None:
        raise ValueError(f"{shortened(text)} is not a number")
    return trimmed


def shortened(value: object, most: int = 60) -> str:
    """Return the `repr` of a value for a message, cut to at most `most` characters."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits
        text = f"a {type(value).__name__} of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def distinct(value: float, other: float) -> str:
    """Return the text of `value` with three significant digits, or with more if `other` would look the same.

    If both values are equal, the text has up to six significant digits.
    """
    digits = next((n for n in range(3, 17) if f"{value:.{n}g}" != f"{other:.{n}g}"), 17)
    return f"{value:.{digits}g}" if value != other else f"{value:g}"
