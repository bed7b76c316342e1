"""CRC-32 checksums of a log: one for each row, one for each event, one for the metadata, one for the end of the log.

HDF5's own Fletcher-32 filter has one checksum for a whole chunk of rows. During a run, that chunk would be unreadable
between the writing of a row and the writing of the checksum. So a log has checksums of its own. These checksums are
computed from the content, not from the bytes of the file. So they also reveal damage to the file's structure that
changes the content. The value 0 marks a checksum that was never written; a checksum of 0 is stored as 1.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Sums = NDArray[np.uint32]

SUM = np.dtype("<u4")
VALUE = np.dtype("<f8")


def row_sums(block: NDArray[np.float64], first_row: int) -> Sums:
    """Return the checksum of each row in `block`, whose columns are in alphabetical order of their names.

    `first_row` is the number of the first row of `block` in the log, counted from 0. The number of a row is part of its
    checksum, so a row in a wrong place does not agree with the checksum of this place.
    """
    rows = memoryview(block.astype(VALUE).tobytes())
    size = VALUE.itemsize * block.shape[1]
    sums = (crc32(rows[n * size : (n + 1) * size], first_row + n) or 1 for n in range(len(block)))
    return np.fromiter(sums, SUM, len(block))


def event_sum(time_s: float, text: bytes, number: int) -> int:
    """Return the checksum of event `number`, counted from 0. `text` must be padded to the fixed length of an event."""
    return crc32(text, crc32(np.array(time_s, VALUE).tobytes(), number)) or 1


def metadata_sum(start_time: str, version: str, columns: Iterable[str], metadata: Mapping[str, str]) -> int:
    """Return the checksum of start time, version, names of all columns and metadata, which are fixed before the run."""
    return _text_sum([start_time, version, sorted(columns), sorted(metadata.items())])


def end_sum(end_time: str, rows: int, events: int) -> int:
    """Return the checksum of the end of a log: the end time, the number of rows and the number of events."""
    return _text_sum([end_time, rows, events])


def first_bad(found: Sums, expected: Sums) -> int | None:
    """Return the index of the first checksum in `found` that differs from `expected`, None if all agree."""
    bad = np.flatnonzero(found != expected)
    return int(bad[0]) if bad.size else None


def alphabetical(names: Sequence[str]) -> list[int]:
    """Return the indices that put `names` into alphabetical order."""
    return sorted(range(len(names)), key=names.__getitem__)


def _text_sum(values: list[object]) -> int:
    return crc32(json.dumps(values).encode()) or 1
