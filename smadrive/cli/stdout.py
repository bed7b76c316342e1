"""Standard output of the commands: a failed write raises one ConfigError, without a traceback or a message at exit.

Each line is written at once. So the command that prints the line gets the error, and can still switch the heater off. A
pipe that the reader has closed is not an error for the user.

A character that the encoding of an output does not have is replaced by other characters: in ASCII, "°C"
becomes "deg C".
"""

from __future__ import annotations

import codecs
import io
import os
import sys
from typing import TYPE_CHECKING

from smadrive.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

SUBSTITUTES = {
    "°": "deg ",
    "µ": "u",
    "μ": "u",
    "Ω": "Ohm",
    "±": "+/-",
    "·": "*",
    "×": "x",
    "≤": "<=",
    "≥": ">=",
    "→": "->",
    "–": "-",
    "—": "-",
    "−": "-",
    "…": "...",
    "━": "-",
    "─": "-",
    "│": "|",
    **dict.fromkeys("▁▂▃", "."),
    **dict.fromkeys("▄▅▆", ":"),
    **dict.fromkeys("▇█", "#"),
    "’": "'",
    "“": '"',
    "”": '"',
}
"""The spelling in ASCII of characters that smadrive prints; any other such character becomes a question mark."""

_SUBSTITUTING = "smadrive-substitutes"


def _substitute(error: UnicodeError) -> tuple[str | bytes, int]:
    """Return the substitute for the first character that cannot be encoded. A byte of a file name stays as it is."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    character = error.object[error.start]
    if "\udc80" <= character <= "\udcff":  # how Python holds a byte of a file name that is not UTF-8
        return bytes((ord(character) - 0xDC00,)), error.start + 1
    return SUBSTITUTES.get(character, "?"), error.start + 1


def encodable(text: str) -> str:
    """Return the text as standard output shows it, with its substitutes, so that a table can be laid out."""
    return text.encode(sys.stdout.encoding, sys.stdout.errors or "strict").decode(sys.stdout.encoding, "replace")


class _Output(io.FileIO):
    _has_failed = False

    def write(self, content: ReadableBuffer, /) -> int:
        """Write the content. The first failure raises ConfigError or BrokenPipeError; later output is dropped."""
        if self._has_failed:
            return len(memoryview(content))
        try:
            return super().write(content)
        except OSError as error:
            self._has_failed = True
            if isinstance(error, BrokenPipeError):
                raise
            raise ConfigError(
                "cannot be written", where="standard output", value=error.strerror, cure="redirect it to another place"
            ) from None


def open_stdout() -> None:
    """Replace Python's standard output by one that raises ConfigError at a failed write and substitutes characters.

    If standard output is closed, the null device replaces it, so that no other file gets its descriptor.
    """
    codecs.register_error(_SUBSTITUTING, _substitute)
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors=_SUBSTITUTING)
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 (open as long as the program lasts)
        return
    encoding = sys.stdout.encoding
    raw = _Output(sys.stdout.fileno(), "w", closefd=False)
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding, _SUBSTITUTING, line_buffering=True)
