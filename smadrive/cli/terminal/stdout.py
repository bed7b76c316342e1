"""Standard output of the commands: a failed write raises one ConfigError, without a traceback or a message at exit.

Each line is written at once. So the command that prints the line gets the error, and can still switch the heater off.

If a reader closes the pipe early, as `head` does, the command goes on with the same exit code, and the rest of its
output is dropped. Only `watch` ends then. If standard output fails in any way, `off` writes to standard error, and the
failed write does not change the exit code of `off`. In every command, a failed write to standard error is ignored.

A character that the encoding of an output does not have is replaced by other characters: in ASCII, "°C"
becomes "deg C".
"""

from __future__ import annotations

import codecs
import io
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

from smadrive.display.ascii_text import SUBSTITUTES
from smadrive.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_SUBSTITUTING = "smadrive-substitutes"


def _substitute(error: UnicodeError) -> tuple[str | bytes, int]:
    """Return the substitute for the first character that cannot be encoded, and the index after this character.

    A byte of a file name that is not UTF-8 stays as it is.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    character = error.object[error.start]
    if "\udc80" <= character <= "\udcff":  # surrogateescape: a byte that is not UTF-8
        return bytes((ord(character) - 0xDC00,)), error.start + 1
    return SUBSTITUTES.get(character, "?"), error.start + 1


def encodable(text: str) -> str:
    """Return the text as standard output shows it, with its substitutes, so that a table can be laid out."""
    return text.encode(sys.stdout.encoding, sys.stdout.errors or "strict").decode(sys.stdout.encoding, "replace")


class _Stdout(io.FileIO):
    """Standard output. After a failed write, output goes to the descriptor `spare`; if `spare` is None, it is lost."""

    has_failed = False
    is_unread = False
    spare: int | None = None

    def write(self, content: ReadableBuffer, /) -> int:
        """Write the content. ConfigError if this fails, unless `spare` is set or the reader has closed the pipe."""
        if self.has_failed:
            return self._write_to_spare(content)
        try:
            return super().write(content)
        except OSError as error:
            self.has_failed = True
            self.is_unread = isinstance(error, BrokenPipeError)
            if self.spare is not None or self.is_unread:
                return self._write_to_spare(content)
            raise ConfigError(
                "cannot be written", where="standard output", value=error.strerror, cure="redirect it to another place"
            ) from None

    def _write_to_spare(self, content: ReadableBuffer) -> int:
        if self.spare is not None:
            with suppress(OSError):
                os.write(self.spare, content)
        return memoryview(content).nbytes


class _Stderr(io.FileIO):
    """Standard error. A failed write has no effect, so it changes no exit code."""

    def write(self, content: ReadableBuffer, /) -> int:
        """Write the content, and return its length in bytes. If the write fails, the content is lost; no error."""
        with suppress(OSError):
            return super().write(content)
        return memoryview(content).nbytes


def open_stdout() -> None:
    """Replace Python's standard output and standard error by streams that handle failed writes (see this module).

    If one of the three standard streams is closed, the null device replaces it. Otherwise a port could get its
    descriptor, and a message could go to the device.
    """
    codecs.register_error(_SUBSTITUTING, _substitute)
    if sys.stdin is None:
        sys.stdin = io.TextIOWrapper(io.BufferedReader(io.FileIO(_null_device())), "utf-8")
    if sys.stdout is None:
        raw = _Stdout(_null_device(), "w")
        raw.has_failed = True
        sys.stdout = _text(raw, "utf-8")
    else:
        sys.stdout = _text(_Stdout(sys.stdout.fileno(), "w", closefd=False), sys.stdout.encoding)
    if sys.stderr is None:
        sys.stderr = _text(_Stderr(_null_device(), "w"), "utf-8")
    elif isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr = _text(_Stderr(sys.stderr.fileno(), "w", closefd=False), sys.stderr.encoding)


def _null_device() -> int:
    """Open the null device, also for child processes such as the guardian, and return its descriptor."""
    descriptor = os.open(os.devnull, os.O_RDWR)
    os.set_inheritable(descriptor, True)
    return descriptor


def _text(raw: io.FileIO, encoding: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, _SUBSTITUTING, line_buffering=True)


def is_unread() -> bool:
    """Return True after a write found that the reader of standard output has closed the pipe."""
    raw = _raw_stdout()
    return raw is not None and raw.is_unread


def use_stderr_if_stdout_fails() -> None:
    """From now on, if a write to standard output fails, write this text and all later ones to standard error."""
    raw = _raw_stdout()
    if raw is not None:
        raw.spare = sys.stderr.fileno()


def _raw_stdout() -> _Stdout | None:
    """Return the stream of `open_stdout`, or None in a program that has not called it."""
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw if isinstance(raw, _Stdout) else None
