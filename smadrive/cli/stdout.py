"""Standard output of the commands: a failed write raises one ConfigError, without a traceback or a message at exit.

Each line is written at once. So the command that prints the line gets the error, and can still switch the heater off. A
closed pipe raises BrokenPipeError, which is no error for the user.
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
    """Replace Python's standard output by one whose failed writes raise ConfigError.

    If standard output is closed, the null device replaces it, so that no other file gets its descriptor.
    """
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 (open as long as the program lasts)
        return
    encoding, errors = sys.stdout.encoding, sys.stdout.errors
    raw = _Output(sys.stdout.fileno(), "w", closefd=False)
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=True)
