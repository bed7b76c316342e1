"""TOML texts into tables, within bounds that every config file keeps.

`tomllib` needs minutes for a key of many dots: its time grows with the square of their number. A short line bounds it.
"""

from __future__ import annotations

import tomllib
from typing import Any

MOST_CHARACTERS = 1 << 18
"""The largest config that ships has some 8,000."""

MOST_LINE = 1000
"""Characters of a line; the longest that ships has 255."""


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a text. ValueError, RecursionError for what is no TOML or out of bounds."""
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"{len(text)} characters long, at most {MOST_CHARACTERS} are read: is it a config file?")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MOST_LINE:
            raise ValueError(f"line {number} has {len(line)} characters, at most {MOST_LINE} are read: break it")
    return tomllib.loads(text)
