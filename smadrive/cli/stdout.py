"""Standard output of the commands: a failed write is one ConfigError, instead of a traceback and a message at exit.

Each line is written at once, so that the command that prints it gets the error, and can still switch a heater off. A
pipe that its reader has closed is not an error for the user.
"""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING

from smadrive.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Output(io.FileIO):
    _has_failed = False

    def write(self, content: ReadableBuffer, /) -> int:
        """Write the content. The first failure raises ConfigError, or BrokenPipeError; output after it is dropped."""
        if self._has_failed:
            return len(memoryview(content))
        try:
            return super().write(content)
        except OSError as error:
            self._has_failed = True
            if isinstance(error, BrokenPipeError):
                raise
            raise ConfigError(
                f"cannot be written: {error.strerror}", where="standard output", cure="redirect it to another place"
            ) from None


def open_stdout() -> None:
    """Replace Python's standard output. A closed one becomes the null device, so that no file gets its descriptor."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 (open as long as the program lasts)
        return
    encoding, errors = sys.stdout.encoding, sys.stdout.errors
    raw = _Output(sys.stdout.fileno(), "w", closefd=False)
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=True)
