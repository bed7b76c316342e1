"""The kinds of files: how each kind is recognized, and what messages call it.

An error about a file of the wrong kind names the kind that was found. A TOML file is recognized by keys that only files
of this kind have, a model by the keys of the JSON object, any other file by the beginning of its content. A damaged
file may have no known kind; the function that reads this file then reports the damage. Only regular files are opened:
reading a pipe would wait for a writer, and reading a device may never end.
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
from smadrive.files.number_text import is_number, shortened
from smadrive.files.toml.parsing import parse_toml

HEAD_BYTES = 1 << 20
"""The number of bytes at the beginning of a file that are examined. Every config and every model is smaller."""

HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of every HDF5 file."""


@dataclass(frozen=True)
class FileKind:
    """A kind of file.

    what        its name in messages
    cure        how the user gets a file of this kind
    error       the type of the errors about such a file
    marks       keys that only files of this kind have
    folder      the folder of the shipped files of this kind, below `configs`
    endings     allowed endings of the name of an output file
    is_record   True for measurements that cannot be repeated; such a file is never overwritten
    """

    what: str
    cure: str
    error: type[ConfigError] = ConfigError
    marks: frozenset[str] = frozenset()
    folder: str = ""
    endings: tuple[str, ...] = (".toml",)
    is_record: bool = False

    def has_ending(self, path: Path) -> bool:
        """Return True if the name of `path` has an ending of this kind."""
        return path.suffix.lower() in self.endings


def _config(what: str, folder: str, *marks: str) -> FileKind:
    return FileKind(what, f"give {what} (.toml)", marks=frozenset(marks), folder=folder)


RIG = _config("a rig file", "rigs", "limits", "excitation")
WIRE = _config("a wire file", "wires", "diameter_mm", "length_mm")
PROFILE = _config("a device profile", "devices", "profile", "roles")
SIM = _config("a simulated device", "sims", "transformation", "thermocouple")
FAULTS = _config("a script of faults", "", "faults")
CAMPAIGN = _config("a campaign file", "campaigns", "title", "run")
CONFIGS = (RIG, WIRE, PROFILE, SIM, FAULTS, CAMPAIGN)

MODEL = FileKind(
    "a model file",
    "give a .json file that `smadrive identify` wrote",
    ModelError,
    marks=frozenset({"schema", "kind", "input_range"}),
    endings=(".json",),
)
LOG = FileKind(
    "a log",
    "give an .h5 file that `heat`, `excite`, `run`, `tune`, `watch -o` or `demo` wrote",
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
    """Return the name of a file type, such as 'a pipe', or None for a regular file."""
    return None if stat.S_ISREG(status.st_mode) else _IRREGULAR.get(stat.S_IFMT(status.st_mode), "something else")


def check_regular(path: Path, error: type[ConfigError | DataError | ModelError]) -> None:
    """Raise `error` when `path` is not a regular file. A missing file is no error here: opening it raises an error."""
    try:
        kind = irregular_kind(path.stat())
    except OSError:
        return
    except ValueError as problem:
        raise error(f"not a path: {problem}", where=shortened(str(path)), cure="give the path of a file") from None
    if kind:
        raise error(f"is {kind}, not a regular file", where=path, cure="give the path of a file")


def check_kind(path: Path, expected: FileKind, cure: str = "") -> None:
    """Raise an error when the file is not of the `expected` kind, or not a regular file.

    The error has the type `expected.error`, and the cure `cure` or else `expected.cure`. A file of unknown kind is no
    error.
    """
    check_regular(path, expected.error)
    found = _kind_of(path, expected)
    if found not in (None, expected):
        raise expected.error(
            f"is {found.what}, and {expected.what} is needed here", where=path, cure=cure or expected.cure
        )


def _kind_of(path: Path, expected: FileKind) -> FileKind | None:
    """Return the kind of the file, None if it is unknown or the file cannot be read. `expected` is tried first."""
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
    """Return True if the first two lines have the same number of cells, and the second line contains a number."""
    try:
        header, first = list(csv.reader(text.splitlines()[:2], strict=True))
    except (ValueError, csv.Error):
        return False
    return len(header) == len(first) > 1 and any(map(is_number, first))
