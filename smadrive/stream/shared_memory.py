"""Rows and a status in shared memory: one process writes, other processes read, and none waits for another.

    rows      a ring: new rows overwrite the oldest
    status    one JSON document, which is replaced as a whole

A reader compares the number of a row before and after it copies the row. If the number has changed, the writer was
writing this row, and the reader drops the copy. The version of the status is compared in the same way.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smadrive.runs.columns import Row
from smadrive.stream.mapped_block import MappedBlock, anonymous_memory
from smadrive.stream.samples import COLUMNS, Rows

CAPACITY = 1 << 15
"""Number of rows in the ring: 27 minutes at 20 Hz."""

STATUS_BYTES = 1 << 18

STREAM = np.dtype(
    [
        ("rows_written", "i8"),
        ("status_version", "i8"),  # odd while the status is being written
        ("status_length", "i8"),
        ("status", "u1", STATUS_BYTES),
        ("row_number", "i8", CAPACITY),  # -1 while the row is being written
        ("rows", "f8", (CAPACITY, len(COLUMNS))),
    ]
)
"""The layout of the memory. `SharedReader` can also read a longer layout that begins with these fields."""


class SharedWriter(MappedBlock):
    """The writing end, which creates the memory. `published` is the latest status."""

    layout = STREAM

    def __init__(self) -> None:
        super().__init__(anonymous_memory(self.layout.itemsize))
        self.published: dict[str, Any] = {}

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
        text = np.frombuffer(json.dumps(status).encode(), np.uint8)
        if text.size > STATUS_BYTES:
            raise ValueError(f"the status has {text.size} bytes, limit {STATUS_BYTES}")
        self.published = status
        self._increase("status_version")
        self._block["status"][0, : text.size] = text
        self._block["status_length"] = text.size
        self._increase("status_version")


class SharedReader(MappedBlock):
    """A reading end."""

    layout = STREAM

    @property
    def written(self) -> int:
        """The number of rows that were written since the memory was created."""
        return self._count("rows_written")

    def since(self, number: int) -> tuple[int, Rows]:
        """Return the `number` for the next call, and the rows from row `number` on as an array (rows, columns).

        Rows that newer rows have overwritten are left out.
        """
        numbers, rows = self.rows(number, CAPACITY)
        return (int(numbers[-1]) + 1 if numbers.size else number), rows

    def rows(self, first: int, most: int) -> tuple[NDArray[np.int64], Rows]:
        """Return at most `most` rows from row `first` on: their numbers, and their values as an array (rows, columns).

        Rows that newer rows have overwritten are left out.
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
