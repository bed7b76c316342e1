"""The driver's ends of the two pipes to its guardian: signals to the guardian, and its answers."""

from __future__ import annotations

import os
import select
import time
from contextlib import suppress
from enum import Enum, auto
from typing import IO

MANY = 4096
"""Number of bytes that one read of the pipe returns at most."""


class Reply(Enum):
    """The outcome of a question to the guardian.

    ANSWERED    the answer arrived
    WORKING     other bytes arrived: the guardian lives, and has not finished
    SILENT      no byte arrived: the guardian stands still
    ENDED       the guardian has ended
    """

    ANSWERED = auto()
    WORKING = auto()
    SILENT = auto()
    ENDED = auto()


class Channel:
    """The pipes to and from a guardian. Reads wait for a byte until `do_not_wait` is called.

    has_ended     True once the guardian has closed its end of the pipe
    answered_s    time of the last byte of the guardian, as of `time.monotonic`
    """

    def __init__(self, to_guardian: IO[bytes] | None, from_guardian: IO[bytes] | None) -> None:
        assert to_guardian is not None  # Popen was called with pipes
        assert from_guardian is not None
        self._to, self._from = to_guardian, from_guardian
        self.has_ended = False
        self.answered_s = 0.0

    def write(self, line: bytes) -> None:
        """Write the whole line. After the end of the guardian nothing is written."""
        with suppress(OSError):
            self._to.write(line)

    def first_byte(self, within_s: float) -> bytes:
        """Return the first byte of the guardian; b"" if none arrives in time, or if the guardian has ended."""
        ready, _, _ = select.select((self._from,), (), (), within_s)
        return self._from.read(1) if ready else b""

    def do_not_wait(self) -> None:
        """Let no later read or write wait for the guardian, which may stand still."""
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def send(self, signal: bytes) -> bool:
        """Write a signal and return True if that succeeded. The guardian may be gone or stand still."""
        with suppress(OSError):
            return bool(self._to.write(signal))
        return False

    def received(self) -> bytes:
        """Return the bytes that have arrived, at most `MANY`; b"" if there are none, or if the guardian has ended."""
        data = self._from.read(MANY)  # None if there is no byte, empty if the guardian has ended
        self.has_ended = data == b""
        if data:
            self.answered_s = time.monotonic()
        return data or b""

    def ask(self, request: bytes, answer: bytes, within_s: float) -> Reply:
        """Send a request and wait up to `within_s` for its answer. Bytes that arrived before do not count."""
        give_up_s = time.monotonic() + within_s
        while self.received():
            pass
        self.send(request)
        reply = Reply.SILENT
        while (left_s := give_up_s - time.monotonic()) > 0:
            select.select((self._from,), (), (), left_s)
            received = self.received()
            if self.has_ended:
                return Reply.ENDED
            if answer in received:
                return Reply.ANSWERED
            if received:
                reply = Reply.WORKING
        return reply

    def close(self) -> None:
        """Close both pipes. The guardian notices the end of its driver."""
        self._to.close()
        self._from.close()
