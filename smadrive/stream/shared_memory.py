"""Rows and a status in shared memory: one process writes, other processes read, and none waits for another.

    rows      a ring: new rows overwrite the oldest
    status    one JSON document, which is replaced as a whole

The memory has no name: the processes inherit its file descriptor, so nothing is left behind when a process is killed.
A reader compares the number of a row, or the version of the status, before and after the copy, and drops a copy whose
number or version has changed.
"""

from __future__ import annotations

import json
import mmap
import os
import tempfile
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from smadrive.runs.columns import Row
from smadrive.stream.samples import COLUMNS, Rows

CAPACITY = 1 << 15
"""Number of rows in the ring: 27 minutes at 20 Hz."""

STATUS_BYTES = 1 << 18

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
"""The layout of the shared memory. The counters belong to the channel (see channel.py)."""


class SharedMemory:
    """The memory behind the file descriptor `memory_fd`."""

    def __init__(self, memory_fd: int) -> None:
        self.memory_fd = memory_fd
        self._block = np.frombuffer(mmap.mmap(memory_fd, BLOCK.itemsize), BLOCK)

    def _count(self, name: str) -> int:
        return int(self._block[name][0])

    def _increase(self, name: str) -> None:
        self._block[name][0] += 1


class SharedWriter(SharedMemory):
    """The writing end, a context manager, which creates the memory. `published` is the latest status."""

    def __init__(self) -> None:
        super().__init__(anonymous_memory(BLOCK.itemsize))
        self.published: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Return this end."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the descriptor; mapped memory stays usable."""
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


class SharedReader(SharedMemory):
    """A reading end."""

    @property
    def written(self) -> int:
        """The number of rows that were written since the session began."""
        return self._count("rows_written")

    def since(self, number: int) -> tuple[int, Rows]:
        """Return the `number` to use in the next call, and all rows since row `number` as an array (rows, columns).

        The array does not hold the rows that newer rows have overwritten.
        """
        numbers, rows = self.rows(number, CAPACITY)
        return (int(numbers[-1]) + 1 if numbers.size else number), rows

    def rows(self, first: int, most: int) -> tuple[NDArray[np.int64], Rows]:
        """Return the numbers of the oldest rows since row `first`, and their values as an array (rows, columns).

        These are at most `most` rows. Rows that newer rows have overwritten are left out.
        """
        written = self.written
        oldest = max(first, written - CAPACITY + 1)
        numbers = np.arange(oldest, min(written, oldest + most))
        places, written_numbers = numbers % CAPACITY, self._block["row_number"][0]
        is_whole = written_numbers[places] == numbers
        rows = self._block["rows"][0][places]
        is_whole &= written_numbers[places] == numbers
        return numbers[is_whole], rows[is_whole]

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


def anonymous_memory(size: int) -> int:
    """Create shared memory without a name, and return its file descriptor."""
    if hasattr(os, "memfd_create"):
        memory_fd = os.memfd_create("smadrive")
    else:
        with tempfile.TemporaryFile() as file:
            memory_fd = os.dup(file.fileno())
    os.truncate(memory_fd, size)
    return memory_fd
