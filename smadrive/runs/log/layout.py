"""The layout of a log: an HDF5 file that has room for all expected rows from the start.

The names follow NeXus, a convention for scientific data. The texts that smadrive reads back have a fixed length: HDF5
stores texts of variable length in heaps, and may loop for ever in a damaged heap.

/                       NXroot: attributes `layout`, `checksums`; a link to every column, for readers without NeXus
/entry                  NXentry: start_time, end_time (empty until the run has ended), program_name
/entry/data             NXdata: the columns along `time_s`, float64, each with its `units` and `long_name`
/entry/metadata         NXcollection: texts such as rig, wire and versions, as JSON where they are structured
/entry/events           NXcollection: time_s, message
/entry/checksums        NXcollection: rows, events, metadata, end (uint32; 0 where no checksum was written)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from smadrive.runs.columns import COLUMNS, Column
from smadrive.runs.log.checksums import SUM, VALUE, metadata_sum
from smadrive.runs.log.old_layouts import LAYOUT

CHUNK_ROWS = 1024
"""Number of rows in a chunk. HDF5 stores the rows of a chunk of one column together."""

EVENT_ROWS = 128
"""The room for events grows by this number of events."""

EVENT_BYTES = 400
"""Length of the text of every event in bytes. A shorter text is padded, so that the place of each event is known.

A longer text continues in the next events (see event_text.py).
"""

MOST_OPEN_ROWS = 1000
"""Largest number of rows in one write. A killed writer leaves at most this number of rows without a checksum."""

CHECKSUMS = "CRC-32"
"""Value of the attribute `checksums` in a log with checksums."""

_NOW_BYTES = 32


def create_log(path: Path, columns: Sequence[str], metadata: Mapping[str, str], rows: int) -> None:
    """Create the file at `path` with its metadata, and with room for at least `rows` rows, filled with NaN."""
    started, program_version = time_text(), version("smadrive")
    room = -(-rows // CHUNK_ROWS) * CHUNK_ROWS
    with h5py.File(path, "w") as file:
        file.attrs.update(NX_class="NXroot", default="entry", checksums=CHECKSUMS, layout=LAYOUT)
        entry = _group(file, "entry", "NXentry")
        entry.attrs["default"] = "data"
        entry["start_time"] = _fixed(started)
        entry.create_dataset("end_time", data=np.array(b"", f"S{_NOW_BYTES}"))
        entry["program_name"] = _fixed("smadrive")
        entry["program_name"].attrs["version"] = _fixed(program_version)
        texts = _group(entry, "metadata", "NXcollection")
        for name, text in metadata.items():
            texts[name] = _fixed(text)
        _create_events(_group(entry, "events", "NXcollection"))
        _create_columns(file, _group(entry, "data", "NXdata"), columns, room)
        checksum = metadata_sum(started, program_version, columns, metadata)
        _create_checksums(_group(entry, "checksums", "NXcollection"), checksum, room)


def _create_events(events: h5py.Group) -> None:
    _reserve(events, "time_s", VALUE, EVENT_ROWS, EVENT_ROWS, np.nan).attrs["units"] = "s"
    _reserve(events, "message", h5py.string_dtype("utf-8", EVENT_BYTES), EVENT_ROWS, EVENT_ROWS, None)


def _create_columns(file: h5py.File, data: h5py.Group, names: Sequence[str], room: int) -> None:
    data.attrs.update(axes="time_s", signal="displacement_mm" if "displacement_mm" in names else names[-1])
    for name in names:
        facts = COLUMNS.get(name, Column("", "1", name))
        column = _reserve(data, name, VALUE, room, CHUNK_ROWS, np.nan)
        column.attrs.update(units=facts.unit, long_name=facts.label)
        file[name] = h5py.SoftLink(f"/entry/data/{name}")
    data["time_s"].make_scale("time_s")
    for name in names:
        if name != "time_s":
            data[name].dims[0].attach_scale(data["time_s"])


def _create_checksums(sums: h5py.Group, metadata: int, room: int) -> None:
    _reserve(sums, "rows", SUM, room, CHUNK_ROWS, 0)
    _reserve(sums, "events", SUM, EVENT_ROWS, EVENT_ROWS, 0)
    sums.create_dataset("metadata", data=metadata, dtype=SUM)
    sums.create_dataset("end", data=0, dtype=SUM)


def _reserve(
    group: h5py.Group, name: str, dtype: np.dtype[Any], rows: int, chunk_rows: int, fill: float | None
) -> h5py.Dataset:
    """Return a new dataset of `rows` values, filled with `fill`. All its chunks exist in the file from the start."""
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    return group.create_dataset(
        name, (rows,), dtype, chunks=(chunk_rows,), maxshape=(None,), fillvalue=fill, dcpl=creation
    )


def _fixed(text: str) -> NDArray[np.bytes_]:
    """Return the text in UTF-8, as an HDF5 text of fixed length."""
    data = text.encode()
    return np.array(data, h5py.string_dtype("utf-8", max(1, len(data))))


def _group(parent: h5py.Group, name: str, nexus_class: str) -> h5py.Group:
    group = parent.create_group(name, track_order=True)
    group.attrs["NX_class"] = nexus_class
    return group


def time_text() -> str:
    """Return the present time in the form that a log stores (UTC, ISO 8601)."""
    return datetime.now(UTC).isoformat(timespec="seconds")
