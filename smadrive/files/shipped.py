"""Where the files that ship with smadrive lie: device profiles, wires, rigs, simulated devices."""

from __future__ import annotations

from pathlib import Path

from smadrive.errors import ConfigError
from smadrive.files.kinds import CONFIGS, FileKind, check_kind
from smadrive.files.spelling import meant

_PACKAGE = Path(__file__).parents[1]


def configs_dir() -> Path:
    """The folder `configs`: inside an installed package, beside it in a checkout."""
    for folder in (_PACKAGE / "configs", _PACKAGE.parent / "configs"):
        if folder.is_dir():
            return folder
    raise ConfigError(f"no folder 'configs' in or beside {_PACKAGE}: reinstall smadrive")


def config_file(name: str | Path, wanted: FileKind) -> Path:
    """The file at the path `name` (`*.toml`), or the shipped one of that name.

    ConfigError when it is a file of another kind, or neither: it names the shipped ones, or the one that was meant.
    """
    path, known = Path(name), _shipped(wanted.folder)
    if path.suffix != ".toml" and str(name) in known:
        return known[str(name)]
    check_kind(path, wanted, cure=f"{wanted.cure}, or the name of a shipped one: {', '.join(known)}")
    if path.suffix == ".toml":
        return path
    others = " and ".join(kind.what for kind in CONFIGS if str(name) in _shipped(kind.folder))
    raise ConfigError(
        f"'{name}' is neither a .toml file nor one of the shipped {wanted.folder}: {', '.join(known)}"
        + (f"; it is the name of {others}" if others else meant(str(name), known))
    )


def _shipped(folder: str) -> dict[str, Path]:
    """The shipped files of a folder by their names; none below no folder."""
    return {path.stem: path for path in sorted((configs_dir() / folder).glob("*.toml"))} if folder else {}
