"""The files that ship with smadrive: device profiles, wires, rigs, simulated devices."""

from __future__ import annotations

from pathlib import Path

from smadrive.errors import ConfigError
from smadrive.files.kinds import CONFIGS, FileKind, check_kind
from smadrive.files.spelling import suggestion

_PACKAGE = Path(__file__).parents[1]


def configs_dir() -> Path:
    """Return the folder `configs`, which is in the installed package or beside it. ConfigError when it is missing."""
    for folder in (_PACKAGE / "configs", _PACKAGE.parent / "configs"):
        if folder.is_dir():
            return folder
    raise ConfigError("no folder 'configs' in or beside it", where=_PACKAGE, cure="reinstall smadrive")


def config_file(name: str | Path, expected: FileKind) -> Path:
    """Return `name` as a path if it ends in .toml, otherwise the path of the shipped file with this name.

    ConfigError when the file is of another kind than `expected`, or when no shipped file has that name.
    """
    path, shipped = Path(name), _shipped(expected.folder)
    if path.suffix != ".toml" and str(name) in shipped:
        return shipped[str(name)]
    check_kind(path, expected, cure=f"{expected.cure}, or the name of a shipped one: {', '.join(shipped)}")
    if path.suffix == ".toml":
        return path
    raise ConfigError(
        f"neither a .toml file nor one of the shipped {expected.folder}",
        where=f"'{name}'",
        value=", ".join(shipped),
        cure=_hint(str(name), shipped),
    )


def _hint(name: str, shipped: dict[str, Path]) -> str:
    """Return a hint about shipped files of other kinds with this name, or else a spelling suggestion."""
    others = " and ".join(kind.what for kind in CONFIGS if name in _shipped(kind.folder))
    return f"it is the name of {others}: give one of this list" if others else suggestion(name, shipped)


def _shipped(folder: str) -> dict[str, Path]:
    """Return the shipped files of a folder by their names. The result is empty for a kind without a folder."""
    return {path.stem: path for path in sorted((configs_dir() / folder).glob("*.toml"))} if folder else {}
