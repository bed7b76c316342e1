"""What kind of file lies there: one that is given in place of another is called by what it is.

A TOML file is known by keys that every file of its kind has and none of another kind, a model by those of its JSON,
the rest by how they begin. A file that shows none of this, or that is damaged there, is of no known kind: whoever reads
it says what is wrong with it. Only a regular file is ever opened: a pipe waits for a writer, a device may never end.
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
"""Of a file so much is looked at; every config and every model is smaller."""

HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class FileKind:
    """A kind of file: how messages call it, where to get one, what its reader raises.

    `marks` are the keys that it is known by; `folder`, below `configs`, holds the shipped ones.
    """

    what: str
    cure: str
    error: type[ConfigError] = ConfigError
    marks: frozenset[str] = frozenset()
    folder: str = ""


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
)
LOG = FileKind("a log", "give one (.h5) that `excite`, `run` or `demo` wrote", DataError)
TABLE = FileKind("a table (CSV)", "give a .csv with a header line", DataError)
PAGE = FileKind("a page (HTML)", "give an .html file", DataError)


_IRREGULAR = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def irregular_kind(found: os.stat_result) -> str | None:
    """What that is which is no regular file; None when it is one."""
    return None if stat.S_ISREG(found.st_mode) else _IRREGULAR.get(stat.S_IFMT(found.st_mode), "something else")


def check_regular(path: Path, error: type[ConfigError | DataError | ModelError]) -> None:
    """The given error when something other than a regular file is at `path`; whether anything is, its reader tells."""
    try:
        kind = irregular_kind(path.stat())
    except OSError:
        return
    except ValueError as problem:
        raise error(f"{shortened(str(path))}: is no path ({problem}): give the path of a file") from None
    if kind:
        raise error(f"{path}: is {kind}, no regular file: give the path of a file")


def check_kind(path: Path, wanted: FileKind, cure: str = "") -> None:
    """The error of `wanted` when the file is one of another kind, with its cure or the given one, or no regular one."""
    check_regular(path, wanted.error)
    found = _kind_of(path, wanted)
    if found not in (None, wanted):
        raise wanted.error(f"{path}: is {found.what}, and {wanted.what} is wanted here: {cure or wanted.cure}")


def _kind_of(path: Path, wanted: FileKind) -> FileKind | None:
    """The kind of the file, `wanted` before others; None when it is of none, or cannot be read."""
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
    return _marked(_keys(parse_toml, text), wanted, *CONFIGS) or (TABLE if _is_table(text) else None)


def _marked(keys: frozenset[str], *kinds: FileKind) -> FileKind | None:
    return next((kind for kind in kinds if kind.marks and kind.marks <= keys), None)


def _keys(parse: Any, text: str) -> frozenset[str]:
    try:
        return frozenset(parse(text))
    except (ValueError, RecursionError):
        return frozenset()


def _is_table(text: str) -> bool:
    """A header line, and below it a line of as many cells with a number among them."""
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
