"""Parsing of TOML texts with limits on their size.

`tomllib` needs a time that grows with the square of the number of dots in a key. A limit on the length of a line keeps
this time short.
"""

from __future__ import annotations

import tomllib
from typing import Any

from smadrive.files.toml.mistakes import TomlMistakeError, find_mistake

MOST_CHARACTERS = 1 << 18
"""The largest number of characters of a text. The largest shipped config has about 8,000."""

MOST_LINE = 1000
"""The largest number of characters of a line. The longest line of a shipped config has 255."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text. ValueError or RecursionError when the text is too large or not valid TOML.

    The ValueError is a TomlMistakeError when the reason is a frequent mistake.
    """
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"{len(text)} characters long, at most {MOST_CHARACTERS} are allowed: is it a config file?")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MOST_LINE:
            raise ValueError(f"line {number} has {len(line)} characters, at most {MOST_LINE} are allowed: break it up")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        mistake = find_mistake(text, str(error))
        if mistake is None:
            raise
        raise TomlMistakeError(mistake) from None
