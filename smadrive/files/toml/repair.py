"""Reads a TOML text with mistakes as far as possible, so that `smadrive off` works with a rig file that has mistakes.

A line that the parser rejects is replaced by its most likely correction. If there is no correction, or the parser
rejects the correction too, the line is left out. A rejected header of a table becomes the header of a table that
nothing reads. Otherwise the keys below this header would become keys of the table above it. A rejected header of a list
of tables gets its double brackets.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from smadrive.files.toml.mistakes import TomlMistakeError
from smadrive.files.toml.parsing import parse_toml

MOST_REPAIRS = 50
"""The largest number of lines that are replaced. A text with more mistakes is not a config file."""

_LINE = re.compile(r"line (\d+)")
_OPEN_BRACKET = re.compile(r"[^#]*=\s*[\[{][^\]}]*")
_HEADER = re.compile(r"\s*\[+\s*([\w.-]+)\s*\]*\s*(?:#.*)?")


class Repair(NamedTuple):
    """A replaced line: its number, the name of its table ("" above the first table), and the parser's error."""

    line: int
    table: str
    error: ValueError


def repaired_toml(text: str) -> tuple[dict[str, Any], list[Repair]]:
    """Return the tables of a TOML text, read as far as possible, and the replaced lines.

    ValueError or RecursionError when the text is too large, nested too deeply or has too many mistakes.
    """
    given = text.split("\n")
    lines, repairs = [*given], dict[int, Repair]()
    while True:
        try:
            return parse_toml("\n".join(lines)), [*repairs.values()]
        except ValueError as error:
            number = _line_of(error, lines)
            if number is None or len(repairs) == MOST_REPAIRS or lines[number - 1] == "":
                raise next((repair.error for repair in repairs.values()), error) from None
            lines[number - 1] = "" if number in repairs else _replacement(error, given[number - 1], number)
            repairs.setdefault(number, Repair(number, _table_of(given, number), error))


def _line_of(error: ValueError, lines: list[str]) -> int | None:
    """Return the number of the line that the parser rejects; None if it is unknown.

    If a bracket is never closed, the parser names a later line or the end of the text; the result is then the line of
    the bracket. For any other error at the end of the text, the result is the last line that is not empty.
    """
    if isinstance(error, TomlMistakeError):
        return error.mistake.line
    filled = (number for number, line in enumerate(lines, 1) if line.strip())
    places = _LINE.findall(str(error))
    last = int(places[-1]) if places else max(filled, default=None)
    if str(error).startswith("Unclosed"):
        opening = (number for number, line in enumerate(lines[:last], 1) if _OPEN_BRACKET.fullmatch(line))
        return max(opening, default=last)
    return last


def _replacement(error: ValueError, line: str, number: int) -> str:
    if isinstance(error, TomlMistakeError):
        return error.mistake.corrected
    if (header := _HEADER.fullmatch(line)) is None:
        return f"[_unreadable_{number}]" if line.lstrip().startswith("[") else ""
    is_list = line.lstrip().startswith("[[") or line.rstrip().endswith("]]")
    return f"[[{header[1]}]]" if is_list else f"[_unreadable_{number}]"


def _table_of(lines: list[str], number: int) -> str:
    """Return the name of the table that a line belongs to, taken from the nearest header at or above the line."""
    headers = (_HEADER.fullmatch(line) for line in reversed(lines[:number]))
    return next((header[1] for header in headers if header is not None), "")
