"""Standard output as the commands write to it: what cannot be written is told in one sentence, once.

Python tells it by a traceback, and once more at its end. Each line is written at once, so that the command which wrote
it learns of it: with a heater on, that command still knows how to end. A pipe that its reader has closed is no fault.
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
        """ConfigError when it cannot be written, and BrokenPipeError when nobody reads it; afterwards it is dropped."""
        if self._has_failed:
            return len(memoryview(content))
        try:
            return super().write(content)
        except OSError as error:
            self._has_failed = True
            if isinstance(error, BrokenPipeError):
                raise
            raise ConfigError(
                f"standard output cannot be written ({error.strerror}): is its disk full? send it elsewhere"
            ) from None


def open_stdout() -> None:
    """Put it in the place of Python's. Where none is open it leads nowhere, and no other file gets its number."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 (open as long as the program lasts)
        return
    encoding, errors = sys.stdout.encoding, sys.stdout.errors
    raw = _Output(sys.stdout.fileno(), "w", closefd=False)
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=True)
