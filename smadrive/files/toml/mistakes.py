"""Frequent mistakes in a TOML file, which get an error of their own.

They are: a decimal comma, a missing quote, a text without quotes, a date in another form, True or False with a capital
letter, and a key that is given twice. The parser's message names only the line and the broken rule of the format. The
error here also names the value and the cure.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from smadrive.files.number_text import shortened, with_decimal_point

QUOTES = "\"'"
"""The two characters that begin and end a text."""

_PLACE = re.compile(r"\(at line (\d+), column \d+\)$")
_ENTRY = re.compile(r"""\s*[\w.-]+\s*=\s*(?P<value>[^"'#\[{]*[^"'#\[{\s])\s*(?:#.*)?""")
_TWICE = "Cannot overwrite a value"
"""The beginning of the parser's message about a key that a table already has."""

_KEY = re.compile(r"\s*[\w.-]+\s*=\s*")
_COMMENT = re.compile(r"\s+#.*")
_DATE = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})")
_BARE_TEXT = re.compile(r"[^\W\d][^=]*|[./~][^=]*[^\W\d][^=]*")


class Mistake(NamedTuple):
    """A mistake in a line: what is wrong, the value that was found, and what the user does about it.

    `corrected` is the line that the user most likely meant, or "" if this is unknown.
    """

    line: int
    what: str
    value: str
    cure: str
    corrected: str


class TomlMistakeError(ValueError):
    """A TOML text with a frequent mistake."""

    def __init__(self, mistake: Mistake) -> None:
        super().__init__(f"line {mistake.line}: {mistake.what} ({mistake.value})")
        self.mistake = mistake


def find_mistake(text: str, message: str) -> Mistake | None:
    """Return the frequent mistake that caused the parser's `message`, or None for another mistake.

    The function examines the line that the message names. If the message names no line, the function examines the first
    line with a quote that is not closed.
    """
    lines = text.split("\n")
    place = _PLACE.search(message)
    if place is None:
        unclosed = (number for number, line in enumerate(lines, 1) if _ends_in_quotes(line))
        return next((_missing_quote(number, lines[number - 1]) for number in unclosed), None)
    number = int(place[1])
    line = lines[number - 1]
    if message.startswith(_TWICE):
        return Mistake(number, "a key is given twice", line.strip(), "keep one of the two lines", "")
    if _ends_in_quotes(line):
        return _missing_quote(number, line)
    entry = _ENTRY.fullmatch(line)
    return None if entry is None else _bare_value(number, entry)


def _missing_quote(number: int, line: str) -> Mistake:
    found = _COMMENT.sub("", line).strip()
    key = _KEY.match(found)
    corrected = found if key is None else f'{key[0]}"{found[key.end() :].strip(QUOTES)}"'
    return Mistake(number, "a quote is missing", found, "put the text between two quotes of one kind", corrected)


def _bare_value(number: int, entry: re.Match[str]) -> Mistake | None:
    value = entry["value"]
    before = entry[0][: entry.start("value")]
    decimal = with_decimal_point(value)
    if decimal is not None:
        return Mistake(number, "a number has a decimal comma", value, f"write {decimal}", before + decimal)
    if (date := _DATE.fullmatch(value)) is not None:
        written = f"{date[3]}-{int(date[2]):02}-{int(date[1]):02}"
        return Mistake(number, "a date has another form", value, f"write {written} (year-month-day)", before + written)
    if (lower := value.lower()) in {"true", "false"}:
        return Mistake(number, "a truth value has a capital letter", value, f"write {lower}", before + lower)
    if _BARE_TEXT.fullmatch(value):
        text = f'"{value}"'
        return Mistake(number, "a text has no quotes", shortened(value)[1:-1], f"write {text}", before + text)
    return None


def _ends_in_quotes(line: str) -> bool:
    """Return True if a quoted text begins in `line` and does not end in it."""
    quote = ""
    for character in line:
        if character == "#" and not quote:
            return False
        if character in QUOTES and quote in {"", character}:
            quote = "" if quote else character
    return bool(quote)
