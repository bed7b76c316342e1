"""The content of a log file, read and verified by its checksums.

Another process may still be writing the log. So the checksums are read before the rows: a row whose checksum was
already there is complete. A killed writer leaves at most `MOST_OPEN_ROWS` rows without a checksum at the end.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.runs.log.checksums import SUM, VALUE, Sums, end_sum, event_sum, first_bad, metadata_sum, row_sums
from smadrive.runs.log.errors import DamageError
from smadrive.runs.log.event_text import joined
from smadrive.runs.log.layout import EVENT_BYTES, MOST_OPEN_ROWS
from smadrive.runs.log.old_layouts import layout_of, metadata_group, translated
from smadrive.runs.log.self_contained import check_self_contained
from smadrive.runs.log.text_heap import heap_text

Columns = dict[str, NDArray[np.float64]]
Events = list[tuple[float, str]]

UNCHECKED = {"start_time", "end_time", "program_name", "about", "events", "data"}
"""The members of `/entry` in the first logs of version 0.1, which have no checksums.

A log with other members was written with checksums. If the checksums are missing, the log is damaged.
"""

UNCHECKED_VERSION = "0.1.0"

DIFFERENT = "the content does not agree with its checksum"


class Content(NamedTuple):
    """The content of a log file. The columns have their present names, even if the log has an older layout.

    `end_time` is empty if the writer was killed, or still writes. `version` is the version of smadrive that wrote the
    log.
    """

    columns: Columns
    metadata: dict[str, str]
    events: Events
    start_time: str
    end_time: str
    version: str
    has_checksums: bool


class _Checksums(NamedTuple):
    rows: Sums
    events: Sums
    metadata: int
    end: int


class _RawEvents(NamedTuple):
    times_s: NDArray[np.float64]
    messages: NDArray[Any]

    def first(self, count: int) -> Events:
        texts = [bytes(text).rstrip(b"\0").decode(errors="ignore") for text in self.messages[:count]]
        return list(zip(self.times_s[:count].tolist(), texts, strict=True))


def read_content(file: h5py.File, size: int) -> Content:
    """Return the verified content of the open `file`, which has `size` bytes.

    ForeignContentError when the file is not self-contained (see self_contained.py), NewerLayoutError when a later
    smadrive wrote the file, DamageError when a checksum differs or a part is missing. For other damage, h5py and Python
    raise errors of many types.
    """
    check_self_contained(file, size)
    layout, entry = layout_of(file), file["entry"]
    content = _checked(entry, layout) if _has_checksums(file, entry) else _unchecked(entry)
    return content._replace(columns=translated(content.columns, layout))


def _has_checksums(file: h5py.File, entry: h5py.Group) -> bool:
    """Return True if the log has checksums, False if it never had any. DamageError when they are lost."""
    if "checksums" in entry:
        return True
    if "checksums" in file.attrs or set(entry) != UNCHECKED:
        raise DamageError("the checksums are missing")
    return False


def _checked(entry: h5py.Group, layout: int) -> Content:
    """Return the verified content of a log with checksums. Rows and events without a checksum are left out."""
    sums = _checksums(entry["checksums"])
    metadata = {name: _text(dataset) for name, dataset in entry[metadata_group(layout)].items()}
    start_time, version = _text(entry["start_time"]), _version(entry["program_name"])
    end_time, columns, events = _end_time(entry), _columns(entry), _raw_events(entry)
    if sums.metadata != metadata_sum(start_time, version, columns, metadata):
        raise DamageError(DIFFERENT, place="metadata")
    columns, verified_events = _verified_rows(columns, sums.rows), _verified_events(events, sums.events)
    if sums.end and sums.end != end_sum(end_time, columns["time_s"].size, len(verified_events)):
        raise DamageError(DIFFERENT, place="end of the log")
    end_time = end_time if sums.end else ""
    return Content(columns, metadata, joined(verified_events), start_time, end_time, version, has_checksums=True)


def _unchecked(entry: h5py.Group) -> Content:
    """Return the content of a log without checksums.

    The writer wrote the time of a row last, so a row with a time is complete. Rows without a time are left out.
    """
    metadata = {name: _unchecked_text(dataset) for name, dataset in entry["about"].items()}
    columns, events = _columns(entry), _raw_events(entry)
    columns = _first_rows(columns, int(np.count_nonzero(np.isfinite(columns["time_s"]))))
    return Content(
        columns,
        metadata,
        joined(events.first(int(np.count_nonzero(np.isfinite(events.times_s))))),
        _unchecked_text(entry["start_time"]),
        _end_time(entry),
        UNCHECKED_VERSION,
        has_checksums=False,
    )


def _checksums(group: h5py.Group) -> _Checksums:
    return _Checksums(
        _values(group["rows"], SUM), _values(group["events"], SUM), int(group["metadata"][()]), int(group["end"][()])
    )


def _columns(entry: h5py.Group) -> Columns:
    columns = {name: _values(column, VALUE) for name, column in entry["data"].items()}
    if "time_s" not in columns:
        raise DamageError("the column is missing", place="time_s")
    return columns


def _raw_events(entry: h5py.Group) -> _RawEvents:
    messages = _values(entry["events/message"], np.dtype(f"S{EVENT_BYTES}"))
    return _RawEvents(_values(entry["events/time_s"], VALUE), messages)


def _verified_rows(columns: Columns, sums: Sums) -> Columns:
    """Return the rows that have a checksum.

    DamageError when a checksum differs, or when more than `MOST_OPEN_ROWS` rows have none.
    """
    rows = _written(sums, "rows")
    verified = _first_rows(columns, rows)
    block = np.column_stack([verified[name] for name in sorted(verified)])
    if (bad := first_bad(sums[:rows], row_sums(block, 0))) is not None:
        raise DamageError(DIFFERENT, place=f"sample {bad + 1}")
    if np.count_nonzero(np.isfinite(columns["time_s"][rows:])) > MOST_OPEN_ROWS:
        raise DamageError("the checksums are missing from here on", place=f"sample {rows + 1}")
    return verified


def _verified_events(events: _RawEvents, sums: Sums) -> Events:
    """Return the events that have a checksum. DamageError when a checksum differs, or an event is missing."""
    count = _written(sums, "events")
    if min(events.times_s.size, events.messages.size) < count:
        raise DamageError(f"the log has checksums of {count} events, but fewer events")
    padded = (bytes(text).ljust(EVENT_BYTES, b"\0") for text in events.messages[:count])
    pairs = zip(events.times_s.tolist(), padded, strict=False)
    expected = np.array([event_sum(time_s, text, n) for n, (time_s, text) in enumerate(pairs)], SUM)
    if (bad := first_bad(sums[:count], expected)) is not None:
        raise DamageError(DIFFERENT, place=f"event {bad + 1}")
    return events.first(count)


def _written(sums: Sums, what: str) -> int:
    """Return the number of written checksums of `what`. DamageError when a checksum before the last one is missing."""
    count = int(np.count_nonzero(sums))
    if not sums[:count].all():
        raise DamageError("checksums are missing", place=what)
    return count


def _first_rows(columns: Columns, rows: int) -> Columns:
    if any(values.size < rows for values in columns.values()):
        raise DamageError(f"the log has {rows} rows, but a column has fewer")
    return {name: values[:rows] for name, values in columns.items()}


def _values(dataset: h5py.Dataset, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return all values of a dataset. DamageError unless the dataset has one axis and the type `dtype`."""
    if dataset.ndim != 1 or dataset.dtype != dtype:
        raise DamageError(f"{dataset.name} is not a column of {dtype}")
    values: NDArray[Any] = dataset[:]
    return values


def _end_time(entry: h5py.Group) -> str:
    return str(entry["end_time"][()].decode("ascii"))


def _text(dataset: h5py.Dataset) -> str:
    if dataset.shape != () or not _is_fixed_text(dataset.id.get_type()):
        raise DamageError(f"{dataset.name} is not a text of fixed length")
    return bytes(dataset[()]).decode()


def _version(program: h5py.Dataset) -> str:
    """Return the version of smadrive that wrote the log. DamageError unless it is a text of fixed length."""
    if not _is_fixed_text(program.attrs.get_id("version").get_type()):
        raise DamageError("the version is not a text of fixed length")
    return bytes(program.attrs["version"]).decode()


def _is_fixed_text(kind: object) -> bool:
    return isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()


def _unchecked_text(dataset: h5py.Dataset) -> str:
    """Return a text of a log without checksums. The texts of such a log have a variable length."""
    return heap_text(dataset.file.id.get_vfd_handle(), dataset.id.get_offset()).decode()
