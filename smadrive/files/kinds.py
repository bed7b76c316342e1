"""The kinds of files: how each is recognized, named and written. A file of another kind is rejected by its own name.

A TOML file is recognized by keys that every file of its kind has and no other kind has, a model by the keys of its
JSON, the others by their first bytes. A damaged file may be of no known kind; its reader then reports the damage. Only
regular files are opened: a pipe waits for a writer, and a device may never end.
"""

from __future__ import annotations

import csv
import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from smadrive.errors import ConfigError, DataError, ModelError
from smadrive.files.number_text import parse_number, shortened
from smadrive.files.toml import parse_toml

HEAD_BYTES = 1 << 20
"""This much of a file is examined; every config and every model is smaller."""

HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class FileKind:
    """A kind of file: its name in messages, how to get one, and the error of its reader.

    `marks`: the keys that identify it. `folder`: the folder of the shipped ones, below `configs`. `endings`: how the
    name of an output file of this kind ends. `is_record`: it cannot be made again, so it is never overwritten.
    """

    what: str
    cure: str
    error: type[ConfigError] = ConfigError
    marks: frozenset[str] = frozenset()
    folder: str = ""
    endings: tuple[str, ...] = (".toml",)
    is_record: bool = False

    def has_ending(self, path: Path) -> bool:
        """Whether the name of `path` ends as a file of this kind does."""
        return path.suffix.lower() in self.endings


def _config(what: str, folder: str, *marks: str) -> FileKind:
    return FileKind(what, "give such a .toml file", marks=frozenset(marks), folder=folder)


RIG = _config("a rig file", "rigs", "limits", "excitation")
WIRE = _config("a wire file", "wires", "diameter_mm", "length_mm")
PROFILE = _config("a device profile", "devices", "profile", "roles")
SIM = _config("a simulated device", "sims", "transformation", "thermocouple")
FAULTS = _config("a script of faults", "", "faults")
CONFIGS = (RIG, WIRE, PROFILE, SIM, FAULTS)

MODEL = FileKind(
    "a model file",
    "give one (.json) that `smadrive identify` wrote",
    ModelError,
    marks=frozenset({"schema", "kind", "input_range"}),
    endings=(".json",),
)
LOG = FileKind(
    "a log",
    "give one (.h5) that `excite`, `run` or `demo` wrote",
    DataError,
    endings=(".h5", ".hdf5", ".nxs"),
    is_record=True,
)
TABLE = FileKind("a table (CSV)", "give a .csv with a header line", DataError, endings=(".csv",))
PAGE = FileKind("a page (HTML)", "give an .html file", DataError, endings=(".html", ".htm"))


_IRREGULAR = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def irregular_kind(status: os.stat_result) -> str | None:
    """What a file is that is not a regular file, such as 'a pipe'; None for a regular file."""
    return None if stat.S_ISREG(status.st_mode) else _IRREGULAR.get(stat.S_IFMT(status.st_mode), "something else")


def check_regular(path: Path, error: type[ConfigError | DataError | ModelError]) -> None:
    """Raise `error` when `path` is not a regular file. A missing file is left to its reader."""
    try:
        kind = irregular_kind(path.stat())
    except OSError:
        return
    except ValueError as problem:
        raise error(f"not a path: {problem}", where=shortened(str(path)), cure="give the path of a file") from None
    if kind:
        raise error(f"is {kind}, not a regular file", where=path, cure="give the path of a file")


def check_kind(path: Path, expected: FileKind, cure: str = "") -> None:
    """Raise the error of `expected` when the file is of another kind or not a regular file; `cure` replaces its own."""
    check_regular(path, expected.error)
    found = _kind_of(path, expected)
    if found not in (None, expected):
        raise expected.error(
            f"is {found.what}, and {expected.what} is needed here", where=path, cure=cure or expected.cure
        )


def _kind_of(path: Path, expected: FileKind) -> FileKind | None:
    """The kind of the file, `expected` tried first; None when it is unknown or the file cannot be read."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return None
    if head.startswith(HDF5):
        return LOG
    text = head.decode("utf-8", errors="replace").lstrip("\ufeff \t\r\n")
    if text[:15].lower().startswith(("<!doctype html", "<html")):
        return PAGE
    if text.startswith("{"):
        return _marked(_keys(json.loads, text), MODEL)
    return _marked(_keys(parse_toml, text), expected, *CONFIGS) or (TABLE if _is_table(text) else None)


def _marked(keys: frozenset[str], *kinds: FileKind) -> FileKind | None:
    return next((kind for kind in kinds if kind.marks and kind.marks <= keys), None)


def _keys(parse: Any, text: str) -> frozenset[str]:
    try:
        return frozenset(parse(text))
    except (ValueError, RecursionError):
        return frozenset()


def _is_table(text: str) -> bool:
    """Whether a header line is followed by a line of as many cells, at least one of them a number."""
    try:
        header, first = list(csv.reader(text.splitlines()[:2], strict=True))
    except (ValueError, csv.Error):
        return False
    return len(header) == len(first) > 1 and any(map(_is_number, first))


def _is_number(cell: str) -> bool:
    try:
        parse_number(cell)
    except ValueError:
        return False
    return True
