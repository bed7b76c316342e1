"""The content of a log file, read and proved by its checksums.

A log may still be written while it is read. Its checksums are therefore read before the rows that they belong to: what
has a checksum by then is complete. A writer that was killed leaves rows without one behind the last complete row, at
most `MOST_OPEN_ROWS`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.runs.log.checksums import SUM, VALUE, Sums, end_sum, event_sum, first_bad, metadata_sum, row_sums
from smadrive.runs.log.heap import heap_text
from smadrive.runs.log.layout import EVENT_BYTES, MOST_OPEN_ROWS
from smadrive.runs.log.self_contained import check_self_contained

Columns = dict[str, NDArray[np.float64]]
Events = list[tuple[float, str]]

UNCHECKED = {"start_time", "end_time", "program_name", "about", "events", "data"}
"""What is in the entry of a log without checksums, as version 0.1 wrote it: nothing else, or it is a damaged one."""


UNCHECKED_VERSION = "0.1.0"


class DamageError(Exception):
    """The content is not what was written."""


class Content(NamedTuple):
    """What a log file holds; `end_time` is empty when the log was not ended."""

    columns: Columns
    about: dict[str, str]
    events: Events
    start_time: str
    end_time: str
    version: str
    is_checked: bool


class _Checksums(NamedTuple):
    rows: Sums
    events: Sums
    metadata: int
    end: int


def read_content(file: h5py.File, size: int) -> Content:
    """The content of an open file of `size` bytes.

    ForeignContentError when it refers to other files, DamageError when a checksum does not agree; what else a damaged
    file makes h5py raise passes through.
    """
    check_self_contained(file, size)
    entry = file["entry"]
    sums = _checksums(entry["checksums"]) if _is_checked(file, entry) else None
    text = _unchecked_text if sums is None else _text
    about = {name: text(dataset) for name, dataset in entry["about"].items()}
    start_time, end_time = text(entry["start_time"]), entry["end_time"][()].decode("ascii")
    version = UNCHECKED_VERSION if sums is None else _version(entry["program_name"])
    columns = {name: _values(column, VALUE) for name, column in entry["data"].items()}
    if "time_s" not in columns:
        raise DamageError("no column 'time_s'")
    times_s = _values(entry["events/time_s"], VALUE)
    messages = _values(entry["events/message"], np.dtype(f"S{EVENT_BYTES}"))
    if sums is None:
        columns, events = _finite(columns), _events(times_s, messages, int(np.count_nonzero(np.isfinite(times_s))))
        return Content(columns, about, events, start_time, end_time, version, is_checked=False)
    if sums.metadata != metadata_sum(start_time, version, columns, about):
        raise DamageError("the metadata do not agree with their checksum")
    columns, events = _proved_rows(columns, sums.rows), _proved_events(times_s, messages, sums.events)
    if sums.end and sums.end != end_sum(end_time, columns["time_s"].size, len(events)):
        raise DamageError("the end of the log does not agree with its checksum")
    return Content(columns, about, events, start_time, end_time if sums.end else "", version, is_checked=True)


def _is_checked(file: h5py.File, entry: h5py.Group) -> bool:
    """Whether the log has checksums; DamageError when it lost them."""
    if "checksums" in entry:
        return True
    if "checksums" in file.attrs or set(entry) != UNCHECKED:
        raise DamageError("the checksums are missing")
    return False


def _checksums(group: h5py.Group) -> _Checksums:
    return _Checksums(
        _values(group["rows"], SUM), _values(group["events"], SUM), int(group["metadata"][()]), int(group["end"][()])
    )


def _proved_rows(columns: Columns, sums: Sums) -> Columns:
    """The rows that have a checksum."""
    rows = _written(sums, "rows")
    if any(values.size < rows for values in columns.values()):
        raise DamageError(f"not every column has {rows} rows")
    block = np.column_stack([columns[name][:rows] for name in sorted(columns)])
    bad = first_bad(sums[:rows], row_sums(block, 0))
    if bad is not None:
        raise DamageError(f"sample {bad + 1} does not agree with its checksum")
    if np.count_nonzero(np.isfinite(columns["time_s"][rows:])) > MOST_OPEN_ROWS:
        raise DamageError(f"the checksums after sample {rows} are missing")
    return {name: values[:rows] for name, values in columns.items()}


def _proved_events(times_s: NDArray[np.float64], messages: NDArray[Any], sums: Sums) -> Events:
    """The events that have a checksum."""
    count = _written(sums, "events")
    if min(times_s.size, messages.size) < count:
        raise DamageError(f"not all of the {count} events are there")
    padded = (bytes(text).ljust(EVENT_BYTES, b"\0") for text in messages[:count])
    pairs = zip(times_s.tolist(), padded, strict=False)
    expected = np.array([event_sum(time_s, text, n) for n, (time_s, text) in enumerate(pairs)], SUM)
    if (bad := first_bad(sums[:count], expected)) is not None:
        raise DamageError(f"event {bad + 1} does not agree with its checksum")
    return _events(times_s, messages, count)


def _written(sums: Sums, what: str) -> int:
    """How many have a checksum, without a gap."""
    count = int(np.count_nonzero(sums))
    if not sums[:count].all():
        raise DamageError(f"checksums of {what} are missing")
    return count


def _events(times_s: NDArray[np.float64], messages: NDArray[Any], count: int) -> Events:
    texts = [bytes(text).rstrip(b"\0").decode(errors="ignore") for text in messages[:count]]
    return list(zip(times_s[:count].tolist(), texts, strict=True))


def _finite(columns: Columns) -> Columns:
    """The columns of a log without checksums up to the last row that has its time, which was written last."""
    rows = int(np.count_nonzero(np.isfinite(columns["time_s"])))
    if any(values.size < rows for values in columns.values()):
        raise DamageError(f"not every column has {rows} rows")
    return {name: values[:rows] for name, values in columns.items()}


def _values(dataset: h5py.Dataset, dtype: np.dtype[Any]) -> NDArray[Any]:
    """All values of a dataset along one axis."""
    if dataset.ndim != 1 or dataset.dtype != dtype:
        raise DamageError(f"{dataset.name} is no column of {dtype}")
    values: NDArray[Any] = dataset[:]
    return values


def _text(dataset: h5py.Dataset) -> str:
    kind = dataset.id.get_type()
    if dataset.shape != () or not isinstance(kind, h5py.h5t.TypeStringID) or kind.is_variable_str():
        raise DamageError(f"{dataset.name} is no text of fixed length")
    return bytes(dataset[()]).decode()


def _version(program: h5py.Dataset) -> str:
    """The version of smadrive that wrote the log."""
    kind = program.attrs.get_id("version").get_type()
    if not isinstance(kind, h5py.h5t.TypeStringID) or kind.is_variable_str():
        raise DamageError("the version is no text of fixed length")
    return bytes(program.attrs["version"]).decode()


def _unchecked_text(dataset: h5py.Dataset) -> str:
    """A text of a log without checksums, which is of variable length."""
    return heap_text(dataset.file.id.get_vfd_handle(), dataset.id.get_offset()).decode()
