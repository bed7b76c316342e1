"""Writes the file of a log: HDF5 creates the file with room for all rows, and plain writes fill in the rows.

HDF5 needs milliseconds for a row of many columns. It leaves an unreadable file when the process is killed while HDF5
changes the structure of the file, and it cannot close a file on a full disk. So HDF5 creates the whole file before the
run, fills all columns with NaN, and closes the file. A full disk is noticed before anything is heated. During the run,
each row is written without HDF5, to the place that HDF5 has assigned to the row.

So during the run, the file is a complete HDF5 file that any reader opens; rows that are not written yet read NaN. HDF5
opens the file again when the log is full, to add room for `GROWTH_ROWS` rows or `EVENT_ROWS` events, and at the end, to
cut the columns to the rows that were written. A kill in such a moment can leave an unreadable file. After any other
kill, the log keeps rows of NaN at its end.

layout.py describes the layout. A checksum (checksums.py) is written after its values: a row is complete when its
checksum is there.
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
from smadrive.files.kinds import HDF5
from smadrive.runs.log.checksums import SUM, VALUE, alphabetical, end_sum, event_sum, row_sums
from smadrive.runs.log.event_text import parts_of
from smadrive.runs.log.layout import CHUNK_ROWS, EVENT_BYTES, EVENT_ROWS, create_log, time_text

GROWTH_ROWS = 8 * CHUNK_ROWS
"""A full log gets room for this number of further rows, which last seven minutes at 20 Hz."""

STRUCTURE_BYTES = 1 << 18
"""Upper bound of the bytes that HDF5 needs besides the rows and texts."""

LEAVE = "run again, and do not touch the log or its folder before the run has ended"


class Field:
    """A dataset with one value for each row (or event), and the places of its chunks in the file."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self.name: str = dataset.name
        self.value_bytes: int = dataset.dtype.itemsize
        self._chunk_rows: int = dataset.chunks[0]
        self._offsets: list[int] = []
        self._find(dataset)

    @property
    def rows(self) -> int:
        """Number of rows for which the file has room."""
        return len(self._offsets) * self._chunk_rows

    def grow(self, file: h5py.File, rows: int) -> None:
        """Make room for `rows` more rows; `rows` must be a multiple of the number of rows in a chunk."""
        dataset = file[self.name]
        dataset.resize(self.rows + rows, axis=0)
        self._find(dataset)

    def write(self, handle: int, row: int, values: bytes) -> None:
        """Write `values` into consecutive rows, beginning at `row`. `handle` is the descriptor of the file."""
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
    """A log that is being written; `rows` is the expected number of rows.

    DataError when `path` exists, or when the file cannot be created, for example on a full disk.
    """

    def __init__(
        self, path: Path, columns: Sequence[str], metadata: Mapping[str, str], rows: int = GROWTH_ROWS
    ) -> None:
        self._path = path
        self._rows = self._events = 0
        with creating(path) as partial, self._as_data_error():
            needed = 8 * (len(columns) + 1) * (rows + CHUNK_ROWS) + sum(map(len, metadata.values())) + STRUCTURE_BYTES
            _claim(partial, needed)
            create_log(partial, columns, metadata, rows)
        with self._as_data_error():
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
        """Number of rows written."""
        return self._rows

    def append(self, block: NDArray[np.float64]) -> None:
        """Append the rows of `block`, which has the columns of the log in the same order. The first column is the time.

        The time is written after the other columns, and the checksum after the time: a row with a checksum is complete.
        """
        self._check_untouched()
        with self._as_data_error():
            while self._rows + len(block) > self._row_sums.rows:
                self._grow((*self._columns, self._row_sums), GROWTH_ROWS)
            for n in reversed(range(len(self._columns))):
                self._columns[n].write(self._handle, self._rows, block[:, n].astype(VALUE).tobytes())
            self._row_sums.write(self._handle, self._rows, row_sums(block[:, self._order], self._rows).tobytes())
            self._rows += len(block)

    def add_event(self, time_s: float, message: str) -> None:
        """Write one event. A message longer than `EVENT_BYTES` takes several events of the file."""
        self._check_untouched()
        for part in parts_of(message, EVENT_BYTES):
            self._add_part(time_s, part.ljust(EVENT_BYTES, b"\0"))

    def _add_part(self, time_s: float, text: bytes) -> None:
        checksum = np.array(event_sum(time_s, text, self._events), SUM)
        with self._as_data_error():
            if self._events >= self._event_fields[-1].rows:
                self._grow(self._event_fields, EVENT_ROWS)
            values = (text, np.array(time_s, VALUE).tobytes(), checksum.tobytes())
            for field, value in zip(self._event_fields, values, strict=True):
                field.write(self._handle, self._events, value)
            self._events += 1

    def finish(self) -> None:
        """Cut the log to the rows that were written, store the end time, and close the file."""
        try:
            self._check_untouched()
            with self._as_data_error(), h5py.File(self._path, "r+", locking=False) as file:
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
        """Close and remove the log of a run that recorded nothing. A file that has replaced the log stays."""
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
        """Raise DataError when another program removed, moved, replaced, cut or overwrote the file.

        Further writes into such a file would succeed, but their rows would be lost.
        """
        with self._as_data_error():
            is_in_place = self._is_in_place()
            is_whole = os.fstat(self._handle).st_size >= self._size and os.pread(self._handle, 8, 0) == HDF5
        if not is_in_place:
            raise DataError("the log was removed, moved or replaced while it was written", where=self._path, cure=LEAVE)
        if not is_whole:
            raise DataError(
                "another program cut the log or wrote over it while it was written", where=self._path, cure=LEAVE
            )

    def _is_in_place(self) -> bool:
        """Return True if the path still leads to the open file."""
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._handle))
        except (FileNotFoundError, NotADirectoryError):
            return False

    @contextmanager
    def _as_data_error(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py raises either
            number = getattr(error, "errno", None)  # h5py replaces the system's text of an OSError
            reason = os.strerror(number) if number else str(error).splitlines()[0]
            raise DataError(
                "the log cannot be written",
                where=self._path,
                value=reason,
                cure="check the folder and the free space on its disk",
            ) from None


def _claim(path: Path, size: int) -> None:
    """Reserve `size` bytes on the disk for the file at `path`. OSError when the disk has no room."""
    handle = os.open(path, os.O_WRONLY)
    try:
        os.posix_fallocate(handle, 0, size)
    finally:
        os.close(handle)
