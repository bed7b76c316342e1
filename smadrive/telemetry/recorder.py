"""The log of a run: HDF5, one dataset per quantity along the common dimension `time_s`.

Opens with h5py (`log["temperature_c"][:]`) and, since `time_s` is a dimension scale, with xarray. Every dataset has a
`units` attribute, as in NeXus. Config, model and provenance are attributes of the file; events (faults, notes) are a
dataset of their own. From the first row on the file is in HDF5's single-writer mode, in which every flush leaves a
readable file: rows are buffered and flushed once per `FLUSH_ROWS`, so a killed process loses at most that many.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np

from smadrive.errors import DataError

FLUSH_ROWS = 20
"""One second at the usual 20 Hz."""

EVENT_BYTES = 400
"""Events have a fixed length: single-writer mode knows no others."""

UNITS = {"s": "s", "c": "degC", "a": "A", "v": "V", "w": "W", "mm": "mm"}
"""The unit of a column, told by the suffix of its name."""


class Recorder:
    """Writes rows of named numbers. The first row fixes the columns, `time_s` among them; every row has the same."""

    def __init__(self, path: Path, attributes: Mapping[str, str] | None = None) -> None:
        self._path = path
        self._rows: list[tuple[float, ...]] = []
        self._columns: tuple[str, ...] = ()
        with self._told_plainly("cannot be written"):
            self._file = h5py.File(path, "w", libver="latest")
            self._file.attrs["NX_class"] = "NXentry"
            self._file.attrs["start_time"] = datetime.now(UTC).isoformat()
            for name, text in (attributes or {}).items():
                self._file.attrs[name] = text
            self._events = self._file.create_dataset(
                "events", (0,), f"S{EVENT_BYTES}", chunks=(16,), maxshape=(None,), compression="gzip"
            )

    def __enter__(self) -> Self:
        """Use as a context: the log is complete and closed at the end, whatever ended it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is buffered, and the error that ended the run as its last event."""
        try:
            if error is not None:
                self.event(f"{type(error).__name__}: {error}")
        finally:
            self.close()

    def row(self, values: Mapping[str, float]) -> None:
        """Append one row. DataError when the disk takes no more."""
        if not self._columns:
            self._create(tuple(values))
        self._rows.append(tuple(values[name] for name in self._columns))
        if len(self._rows) >= FLUSH_ROWS:
            self.flush()

    def event(self, text: str) -> None:
        """Append one line to the events, on disk at once."""
        with self._told_plainly("takes no more"):
            self._events.resize(self._events.shape[0] + 1, axis=0)
            self._events[-1] = text.encode()[:EVENT_BYTES]
        self.flush()

    def flush(self) -> None:
        """Put every row so far on the disk."""
        with self._told_plainly("takes no more"):
            self._append()
            self._file.flush()

    def close(self) -> None:
        """Flush and close."""
        try:
            self.flush()
        finally:
            with self._told_plainly("cannot be closed"):
                self._file.close()

    def _append(self) -> None:
        if not self._rows:
            return
        block = np.asarray(self._rows, dtype=np.float64)
        self._rows.clear()
        written = self._file["time_s"].shape[0]
        for n, name in enumerate(self._columns):
            dataset = self._file[name]
            dataset.resize(written + len(block), axis=0)
            dataset[written:] = block[:, n]

    def _create(self, columns: tuple[str, ...]) -> None:
        self._columns = columns
        with self._told_plainly("takes no more"):
            for name in columns:
                dataset = self._file.create_dataset(name, (0,), "f8", chunks=(1024,), maxshape=(None,))
                dataset.attrs["units"] = UNITS.get(name.rpartition("_")[2], "1")
            self._file["time_s"].make_scale("time_s")
            for name in columns:
                if name != "time_s":
                    self._file[name].dims[0].attach_scale(self._file["time_s"])
            self._file.swmr_mode = True

    @contextmanager
    def _told_plainly(self, what: str) -> Iterator[None]:
        """HDF5 puts a stack of causes into its messages; a person needs the last of them."""
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py raises either
            found = re.search(r"error message = '([^']+)'", str(error))
            reason = found[1] if found else str(error).splitlines()[0]
            raise DataError(f"{self._path}: the log {what} ({reason}): check the folder and its space") from None
