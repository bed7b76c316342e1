"""The file of a log: HDF5 with room for its rows from the start, into which rows are put by plain writes.

HDF5 needs milliseconds for a row of many columns, leaves a file that nobody opens when it is killed while it changes
the structure, and cannot even close a file on a full disk. So it has no part in the run: it makes the whole file first,
every place filled with NaN, and closes it; the disk has no room: nothing has been heated yet. Then each row is written
where HDF5 said that its values lie. At every moment the file is a complete HDF5 file that any reader opens; what was
not written yet reads NaN. At the end the columns are cut to the rows there are; a killed writer's log just has a tail
of NaN. Only a log that gets longer than was said opens HDF5 in between, to get room for the next `GROWTH_ROWS` rows.

The layout is in layout.py. A checksum (see checksums.py) is written after what it belongs to: a row is complete when
its checksum is there.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError
from smadrive.files.atomic import creating
from smadrive.runs.log.checksums import SUM, VALUE, alphabetical, end_sum, event_sum, row_sums
from smadrive.runs.log.layout import CHUNK_ROWS, EVENT_BYTES, EVENT_ROWS, create_log, time_text

GROWTH_ROWS = 8 * CHUNK_ROWS
"""Rows that a log of unknown length gets room for at a time: seven minutes at 20 Hz."""

STRUCTURE_BYTES = 1 << 18
"""More than HDF5 needs beside the rows and texts."""

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How every HDF5 file begins."""


class Field:
    """A dataset of one value a row, and where in the file its chunks lie."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self.name: str = dataset.name
        self.value_bytes: int = dataset.dtype.itemsize
        self._chunk_rows: int = dataset.chunks[0]
        self._offsets: list[int] = []
        self._find(dataset)

    @property
    def rows(self) -> int:
        """How many rows there is room for."""
        return len(self._offsets) * self._chunk_rows

    def grow(self, file: h5py.File, rows: int) -> None:
        """Room for `rows` more, a multiple of those of a chunk."""
        dataset = file[self.name]
        dataset.resize(self.rows + rows, axis=0)
        self._find(dataset)

    def write(self, handle: int, row: int, values: bytes) -> None:
        """Put `values` into their places from `row` on."""
        chunk_bytes = self._chunk_rows * self.value_bytes
        position = row * self.value_bytes
        while values:
            chunk, within = divmod(position, chunk_bytes)
            written = os.pwrite(handle, values[: chunk_bytes - within], self._offsets[chunk] + within)
            position, values = position + written, values[written:]

    def _find(self, dataset: h5py.Dataset) -> None:
        new = range(self.rows, len(dataset), self._chunk_rows)
        self._offsets += [dataset.id.get_chunk_info_by_coord((row,)).byte_offset for row in new]


class LogFile:
    """A log being written. `rows`: how many are to come, if that is known.

    DataError when something stands at `path` already, or the disk has no room.
    """

    def __init__(self, path: Path, columns: Sequence[str], about: Mapping[str, str], rows: int = GROWTH_ROWS) -> None:
        self._path = path
        self._rows = self._events = 0
        with creating(path) as partial, self._told_plainly():
            needed = 8 * (len(columns) + 1) * (rows + CHUNK_ROWS) + sum(map(len, about.values())) + STRUCTURE_BYTES
            _claim(partial, needed)
            create_log(partial, columns, about, rows)
        with self._told_plainly():
            self._handle = os.open(path, os.O_RDWR)
            self._size = os.fstat(self._handle).st_size
            with h5py.File(path, "r", locking=False) as file:
                self._columns = [Field(file[f"entry/data/{name}"]) for name in columns]
                self._row_sums = Field(file["entry/checksums/rows"])
                events = ("events/message", "events/time_s", "checksums/events")
                self._event_fields = [Field(file[f"entry/{name}"]) for name in events]
        self._order = alphabetical(columns)

    @property
    def rows(self) -> int:
        """How many were written."""
        return self._rows

    def append(self, block: NDArray[np.float64]) -> None:
        """Write rows, one column of `block` for each of the log's.

        Time comes after the other columns, and the checksum after the time: a row that has it is complete.
        """
        self._check_untouched()
        with self._told_plainly():
            while self._rows + len(block) > self._row_sums.rows:
                self._grow((*self._columns, self._row_sums), GROWTH_ROWS)
            for n in reversed(range(len(self._columns))):
                self._columns[n].write(self._handle, self._rows, block[:, n].astype(VALUE).tobytes())
            self._row_sums.write(self._handle, self._rows, row_sums(block[:, self._order], self._rows).tobytes())
            self._rows += len(block)

    def add_event(self, time_s: float, message: str) -> None:
        """Write one event; of a message the first `EVENT_BYTES` are kept."""
        self._check_untouched()
        text = message.encode()[:EVENT_BYTES].ljust(EVENT_BYTES, b"\0")
        checksum = np.array(event_sum(time_s, text, self._events), SUM)
        with self._told_plainly():
            if self._events >= self._event_fields[-1].rows:
                self._grow(self._event_fields, EVENT_ROWS)
            values = (text, np.array(time_s, VALUE).tobytes(), checksum.tobytes())
            for field, value in zip(self._event_fields, values, strict=True):
                field.write(self._handle, self._events, value)
            self._events += 1

    def finish(self) -> None:
        """Cut the log to the rows there are, note the end, close."""
        try:
            self._check_untouched()
            with self._told_plainly(), h5py.File(self._path, "r+", locking=False) as file:
                for field in (*self._columns, self._row_sums):
                    file[field.name].resize(self._rows, axis=0)
                for field in self._event_fields:
                    file[field.name].resize(self._events, axis=0)
                now = time_text()
                file["entry/end_time"][()] = now.encode()
                file["entry/checksums/end"][()] = end_sum(now, self._rows, self._events)
        finally:
            os.close(self._handle)

    def discard(self) -> None:
        """Close and remove it: nothing was recorded. What another program put in its place stays."""
        try:
            if self._is_in_place():
                self._path.unlink(missing_ok=True)
        finally:
            os.close(self._handle)

    def _grow(self, fields: Sequence[Field], rows: int) -> None:
        size = os.fstat(self._handle).st_size
        _claim(self._path, size + sum(field.value_bytes for field in fields) * rows + STRUCTURE_BYTES)
        with h5py.File(self._path, "r+", locking=False) as file:
            for field in fields:
                field.grow(file, rows)
        self._size = os.fstat(self._handle).st_size

    def _check_untouched(self) -> None:
        """DataError when another program took, replaced or cut the file: writing on would work, and keep nothing."""
        with self._told_plainly():
            is_in_place = self._is_in_place()
            is_whole = os.fstat(self._handle).st_size >= self._size and os.pread(self._handle, 8, 0) == SIGNATURE
        if not is_in_place:
            raise DataError(
                f"{self._path}: the log is gone, removed, moved or replaced while it was written: leave it and its "
                "folder in place until the run has ended, then run again"
            )
        if not is_whole:
            raise DataError(
                f"{self._path}: the log was cut or written over by another program while it was written: let no other "
                "write to it until the run has ended, then run again"
            )

    def _is_in_place(self) -> bool:
        """Whether the file under the name is still the one that is written."""
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._handle))
        except (FileNotFoundError, NotADirectoryError):
            return False

    @contextmanager
    def _told_plainly(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py raises either
            number = getattr(error, "errno", None)  # h5py puts HDF5's own text where the system's should stand
            reason = os.strerror(number) if number else str(error).splitlines()[0]
            raise DataError(f"{self._path}: the log takes no more ({reason}): check the folder and its space") from None


def _claim(path: Path, size: int) -> None:
    """Let the file system say now whether it has room for `size` bytes."""
    handle = os.open(path, os.O_WRONLY)
    try:
        os.posix_fallocate(handle, 0, size)
    finally:
        os.close(handle)
