"""The health record of a wire: the file beside the model file, `wire.health.jsonl` beside `wire.json`.

The file has one JSON object a line, and only grows. Each object has the version of its schema and a CRC-32 of its other
fields. An entry is appended by one `write`, under a lock of the file. So a program that is killed leaves at most an
incomplete last line, and two programs at once leave two lines. `read_health` leaves a damaged line out, with a caveat.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from pydantic import ValidationError

from smadrive.display.number_text import count_text
from smadrive.errors import DataError
from smadrive.files.checked_line import checked_line, fields_of_line
from smadrive.files.kinds import check_regular
from smadrive.posix import fcntl
from smadrive.wire.health.entry import HealthEntry

SCHEMA_VERSION = 1
ENDING = ".health.jsonl"

MOST_BYTES = 1 << 26
"""The largest record, bytes: about 80,000 runs."""

LOCK_WITHIN_S = 2.0
"""Longest wait for another program that holds the lock, s. After this time the entry is written without the lock."""

_LOOK_AGAIN_S = 0.01
_SIDE_PRODUCT = "runs need no record; move the file away to begin a new one"


class HealthRecord(NamedTuple):
    """The entries of a record in the order of the file, and the reasons to distrust them, one sentence each."""

    path: Path
    entries: tuple[HealthEntry, ...] = ()
    caveats: tuple[str, ...] = ()


class _NewerSchemaError(ValueError):
    """A later version of smadrive wrote the line."""


def health_file(wire_file: Path) -> Path:
    """Return the path of the record of the wire in `wire_file`."""
    return wire_file.with_name(wire_file.stem + ENDING)


def read_health(wire_file: Path) -> HealthRecord:
    """Return the record of the wire in `wire_file`; it is empty if the file does not exist.

    Entries that cannot be used are left out, and a caveat counts them. DataError when the file cannot be read, is too
    large, or has only damaged lines; a single incomplete line is no error.
    """
    path = health_file(wire_file)
    content = _content(path)
    entries, newer, damaged = [], [], []
    lines = content.split(b"\n")
    for number, line in enumerate(lines, 1):
        try:
            entries += [_parsed(line)] if line.strip() else []
        except _NewerSchemaError:
            newer.append(number)
        except (ValueError, ValidationError):
            damaged.append(number)
    if damaged and not (entries or newer or damaged == [len(lines)]):
        raise DataError("not a health record, or damaged", where=path, cure=_SIDE_PRODUCT)
    return HealthRecord(path, tuple(entries), tuple(_caveats(path.name, newer, damaged, len(lines))))


def append_entries(wire_file: Path, entries: Sequence[HealthEntry]) -> None:
    """Append `entries` to the record of the wire in `wire_file`, all or none. DataError when that is impossible."""
    path = health_file(wire_file)
    check_regular(path, DataError)
    try:
        with _appending(path) as descriptor:
            _append(descriptor, b"".join(map(_line, entries)))
    except OSError as error:
        what = f"the health of the wire is not recorded: {error.strerror or error}"
        raise DataError(what, where=path, cure="check the folder, its permissions and its free space") from None


def _content(path: Path) -> bytes:
    check_regular(path, DataError)
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise DataError("too large", where=path, value=f"{size} bytes", limit=MOST_BYTES, cure=_SIDE_PRODUCT)
        return path.read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", where=path, cure=_SIDE_PRODUCT) from None


def _line(entry: HealthEntry) -> bytes:
    return checked_line({"schema": SCHEMA_VERSION, **json.loads(entry.model_dump_json())})


def _parsed(line: bytes) -> HealthEntry:
    """Return the entry of a line. ValueError for a damaged line."""
    fields = fields_of_line(line)
    schema = fields.pop("schema", None)
    if isinstance(schema, int) and schema > SCHEMA_VERSION:
        raise _NewerSchemaError
    return HealthEntry.model_validate(fields)


def _caveats(name: str, newer: list[int], damaged: list[int], lines: int) -> Iterator[str]:
    """Yield one sentence for each reason why entries are left out. `newer` and `damaged` are numbers of lines."""
    if damaged and damaged[-1] == lines:
        damaged = damaged[:-1]
        yield f"{name}: the last entry is incomplete and left out: the program that wrote it was killed"
    if damaged:
        yield f"{name}: left out: {count_text(len(damaged), 'damaged line')}, the first is line {damaged[0]}"
    if newer:
        yield f"{name}: left out: {count_text(len(newer), 'line')} of a later version; update smadrive"


@contextmanager
def _appending(path: Path) -> Iterator[int]:
    """Yield the descriptor of the open file. The file is locked if its file system has locks, see `LOCK_WITHIN_S`."""
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        _lock(descriptor)
        yield descriptor
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> None:
    give_up_s = time.monotonic() + LOCK_WITHIN_S
    while time.monotonic() < give_up_s:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_LOOK_AGAIN_S)
        except OSError:  # the file system has no locks
            return
        else:
            return


def _append(descriptor: int, lines: bytes) -> None:
    """Write the lines at the end of the file. After an incomplete last line, begin a new line first."""
    size = os.fstat(descriptor).st_size
    is_cut = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
    text = b"\n" + lines if is_cut else lines
    if os.write(descriptor, text) < len(text):
        os.ftruncate(descriptor, size)
        raise OSError(None, "the disk is full")
    os.fsync(descriptor)
