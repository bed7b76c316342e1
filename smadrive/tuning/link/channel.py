"""The connection of the control process, which runs the loop, with the page process and the front process.

No process waits for another one.

    control → page   rows       a ring in shared memory: the page copies the new rows, new rows overwrite the oldest
    control → page   status     one JSON document in shared memory, which is replaced as a whole
    front → control  OFF        a counter in shared memory: it needs no queue and no answer, and a counted OFF is not
                                lost when the front process dies. Only the front process counts, because two writers
                                could lose a count. A request that drives the wire carries the OFF count that the page
                                had received when the user clicked (see button_events.py)
    page → control   pages      the number of open pages, and whether one of them may change the session (the others
                                only watch)
    page → front     heartbeat  the id of the page process, and the time at which it last read the channel
    front → control  heartbeat  a counter that increases while the front process answers
    both ways        messages   JSON datagrams on a socket pair: each arrives whole or not at all; `send`
                                returns False if the queue is full

The memory has no name: the processes inherit its file descriptor, so nothing is left behind when a process is killed.
A reader compares the number of a row, or the version of the status, before and after the copy, and drops a copy whose
number or version has changed.
See docs/decisions/0001-processes-of-the-tuning-page.md.
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import numpy as np

from smadrive.runs.columns import Row
from smadrive.tuning.link.samples import COLUMNS, Rows

CAPACITY = 1 << 15
"""Number of rows in the ring: 27 minutes at 20 Hz."""

STATUS_BYTES = 1 << 18
MESSAGE_BYTES = 1 << 16
MESSAGES_PER_TICK = 4

BLOCK = np.dtype(
    [
        ("off_count", "i8"),
        ("rows_written", "i8"),
        ("status_version", "i8"),  # odd while the status is being written
        ("status_length", "i8"),
        ("open_pages", "i8"),
        ("is_controlled", "i8"),
        ("page_pid", "i8"),
        ("page_beat_ns", "i8"),
        ("front_beats", "i8"),
        ("status", "u1", STATUS_BYTES),
        ("row_number", "i8", CAPACITY),  # -1 while the row is being written
        ("rows", "f8", (CAPACITY, len(COLUMNS))),
    ]
)
"""The layout of the shared memory."""


class Channel:
    """The common part of `ControlEnd` and `PageEnd`: the shared memory, and one of the two connected sockets."""

    def __init__(self, memory_fd: int, messages: socket.socket) -> None:
        self.memory_fd = memory_fd
        self.messages = messages
        messages.setblocking(False)
        self._block = np.frombuffer(mmap.mmap(memory_fd, BLOCK.itemsize), BLOCK)

    def _count(self, name: str) -> int:
        return int(self._block[name][0])

    def _increase(self, name: str) -> None:
        self._block[name][0] += 1

    def send(self, message: dict[str, Any]) -> bool:
        """Send a message. Return False if the other end is closed, or if its queue is full."""
        with suppress(OSError):
            return self.messages.send(json.dumps(message).encode()) > 0
        return False

    def received(self, limit: int) -> Iterator[bytes]:
        """Yield the messages that have arrived, at most `limit` of them."""
        for _ in range(limit):
            try:
                yield self.messages.recv(MESSAGE_BYTES)
            except OSError:
                return


class ControlEnd(Channel):
    """The control process's side of the channel, a context manager.

    No method waits, and no message of a page makes a method fail. `offs` is the OFF count at the last call of
    `off_requested`, `published` the latest status.
    """

    def __init__(self) -> None:
        self.page_socket, own = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        super().__init__(_anonymous_memory(BLOCK.itemsize), own)
        self.offs = 0
        self.published: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Return this end."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the sockets and the descriptor; mapped memory stays usable."""
        self.messages.close()
        self.page_socket.close()
        os.close(self.memory_fd)

    def append(self, row: Row) -> None:
        """Add one row with the values of `COLUMNS`."""
        number = self._count("rows_written")
        place = number % CAPACITY
        numbers = self._block["row_number"][0]
        numbers[place] = -1
        self._block["rows"][0, place] = row
        numbers[place] = number
        self._increase("rows_written")

    def publish(self, status: dict[str, Any]) -> None:
        """Replace the status. ValueError if its JSON text is longer than `STATUS_BYTES`, a defect of smadrive."""
        self.published = status
        text = np.frombuffer(json.dumps(status).encode(), np.uint8)
        self._increase("status_version")
        self._block["status"][0, : text.size] = text
        self._block["status_length"] = text.size
        self._increase("status_version")

    @property
    def pages(self) -> tuple[int, bool]:
        """The number of open pages, and True if one of them may change the session."""
        return self._count("open_pages"), bool(self._count("is_controlled"))

    @property
    def front_beats(self) -> int:
        """A counter that increases while the front process answers."""
        return self._count("front_beats")

    def off_requested(self) -> bool:
        """Return True if an OFF was counted since the last call. Set `offs` to the present OFF count."""
        count = self._count("off_count")
        is_new, self.offs = count != self.offs, count
        return is_new


class PageEnd(Channel):
    """The side of the channel that the page process and the front process use."""

    def request_off(self) -> None:
        """Count an OFF, which the loop sees at its next tick."""
        self._increase("off_count")

    @property
    def offs(self) -> int:
        """The OFF count: the number of OFFs since the session began."""
        return self._count("off_count")

    def report_pages(self, count: int, *, is_controlled: bool) -> None:
        """Report the number of open pages. `is_controlled` is True if one of them may change the session."""
        self._block["open_pages"], self._block["is_controlled"] = count, is_controlled

    @property
    def pages_open(self) -> int:
        """The number of open pages, as the page process has reported it."""
        return self._count("open_pages")

    def beat(self) -> None:
        """Report that the page process, which calls this method, answers now."""
        self._block["page_pid"], self._block["page_beat_ns"] = os.getpid(), time.monotonic_ns()

    def beat_front(self) -> None:
        """Report that the front process, which calls this method, answers now."""
        self._increase("front_beats")

    def page_server(self, within_s: float) -> int | None:
        """Return the process id of the page process, or None if its last heartbeat is older than `within_s`."""
        age_s = 1e-9 * (time.monotonic_ns() - self._count("page_beat_ns"))
        return self._count("page_pid") if age_s < within_s else None

    @property
    def written(self) -> int:
        """The number of rows that were written since the session began."""
        return self._count("rows_written")

    def since(self, number: int) -> tuple[int, Rows]:
        """Return the `number` to use in the next call, and all rows since row `number` as an array (rows, columns).

        The array does not hold the rows that newer rows have overwritten.
        """
        written = self.written
        numbers = np.arange(max(number, written - CAPACITY + 1), written)
        places, written_numbers = numbers % CAPACITY, self._block["row_number"][0]
        is_whole = written_numbers[places] == numbers
        rows = self._block["rows"][0][places]
        is_whole &= written_numbers[places] == numbers
        return written, rows[is_whole]

    def status(self, seen: int) -> tuple[int, dict[str, Any]] | None:
        """Return the version and the content of the status.

        Return None before the first status, while the version is still `seen`, and while the status is being written.
        """
        version = self._count("status_version")
        if version in (0, seen) or version % 2:
            return None
        text = self._block["status"][0, : self._count("status_length")].tobytes()
        if self._count("status_version") != version:
            return None
        return version, json.loads(text)


def _anonymous_memory(size: int) -> int:
    """Create shared memory without a name, and return its file descriptor."""
    if hasattr(os, "memfd_create"):
        memory_fd = os.memfd_create("smadrive-tuning")
    else:
        with tempfile.TemporaryFile() as file:
            memory_fd = os.dup(file.fileno())
    os.truncate(memory_fd, size)
    return memory_fd
