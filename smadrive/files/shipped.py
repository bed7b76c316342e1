"""The files that ship with smadrive: rigs, wires, device profiles, simulated wires and campaigns."""

from __future__ import annotations

import os
import re
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

from smadrive.errors import ConfigError
from smadrive.files.kinds import (
    CAMPAIGN,
    CONFIGS,
    PROFILE,
    RIG,
    SIM,
    WIRE,
    FileKind,
    check_kind,
)
from smadrive.files.spelling import nearest_name, suggested_file, suggestion

_PACKAGE = Path(__file__).parents[1]


class ShippedFile(NamedTuple):
    """A shipped file: its name as a command accepts it, its path, and the first sentence of its comment."""

    name: str
    path: Path
    what: str


def shipped_files() -> dict[str, list[ShippedFile]]:
    """Return the shipped rigs, wires, device profiles, simulated wires and campaigns, by the name of their folder."""
    kinds = (RIG, WIRE, PROFILE, SIM, CAMPAIGN)
    return {
        kind.folder: [ShippedFile(name, path, _first_sentence(path)) for name, path in _shipped(kind.folder).items()]
        for kind in kinds
    }


def _first_sentence(path: Path) -> str:
    """Return the first sentence of the comment at the head of a file, without the sources."""
    lines = path.read_text(encoding="utf-8").splitlines()
    head = takewhile(lambda line: line.startswith("#") and not line.startswith("# Sources:"), lines)
    text = " ".join(line.removeprefix("#").strip() for line in head)
    return re.split(r"\. (?=[A-Z]|docs/)", text)[0].rstrip(".")


def configs_dir() -> Path:
    """Return the folder `configs`, which is in the installed package or beside it. ConfigError when it is missing."""
    for folder in (_PACKAGE / "configs", _PACKAGE.parent / "configs"):
        if folder.is_dir():
            return folder
    raise ConfigError("no folder 'configs' in or beside it", where=_PACKAGE, cure="reinstall smadrive")


def is_shipped(path: Path) -> bool:
    """Return True if `path` is a file of the folder `configs`."""
    return path.resolve().is_relative_to(configs_dir().resolve())


def config_file(name: str | Path, expected: FileKind) -> Path:
    """Return `name` as a path if it ends in .toml, otherwise the path of the shipped file with this name.

    ConfigError when the file is of another kind than `expected`, or when no shipped file has that name.
    """
    path, shipped = Path(name), _shipped(expected.folder)
    if not str(name).strip():
        cure = f"{expected.cure}, or the name of a shipped one: {', '.join(shipped)}"
        raise ConfigError("the name is empty", where=expected.what, cure=cure)
    if path.suffix != ".toml" and str(name) in shipped:
        return shipped[str(name)]
    check_kind(path, expected, cure=f"{expected.cure}, or the name of a shipped one: {', '.join(shipped)}")
    if path.suffix == ".toml":
        _check_not_a_shipped_name(path, shipped)
        return path
    raise ConfigError(
        f"neither a .toml file nor one of the shipped {expected.folder}",
        where=f"'{name}'",
        value=", ".join(shipped),
        cure=_hint(str(name), shipped),
    )


def _check_not_a_shipped_name(path: Path, shipped: dict[str, Path]) -> None:
    """Raise ConfigError if `path` does not exist, and its name without .toml is similar to a shipped name.

    Do nothing for a path with a folder, and if a file in the current folder has a similar name.
    """
    if path.name != str(path) or os.path.exists(path) or suggested_file(path):
        return
    if (near := nearest_name(path.stem, shipped)) is not None:
        cure = f"did you mean the shipped '{near}', without .toml?"
        raise ConfigError("no such file", where=path, cure=cure)


def _hint(name: str, shipped: dict[str, Path]) -> str:
    """Return a hint if shipped files of other kinds have this name, otherwise a spelling suggestion."""
    others = " and ".join(kind.what for kind in CONFIGS if name in _shipped(kind.folder))
    return f"it is the name of {others}: give one of this list" if others else _near(name, shipped)


def _near(name: str, shipped: dict[str, Path]) -> str:
    """Return a spelling suggestion: the file NAME.toml, the nearest shipped name, or the nearest .toml file."""
    path = Path(f"{name}.toml")
    return (os.path.isfile(path) and suggested_file(path)) or suggestion(name, shipped) or suggested_file(path)


def _shipped(folder: str) -> dict[str, Path]:
    """Return the shipped files of a folder by their names. The result is empty for a kind without a folder."""
    return {path.stem: path for path in sorted((configs_dir() / folder).glob("*.toml"))} if folder else {}
