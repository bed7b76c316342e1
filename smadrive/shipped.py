"""Where the files that ship with smadrive lie: device profiles, wires, rigs, simulated devices."""

from __future__ import annotations

from pathlib import Path

from smadrive.errors import ConfigError

_PACKAGE = Path(__file__).parent


def configs_dir() -> Path:
    """The folder `configs`: inside an installed package, beside it in a checkout."""
    for folder in (_PACKAGE / "configs", _PACKAGE.parent / "configs"):
        if folder.is_dir():
            return folder
    raise ConfigError(f"no folder 'configs' in or beside {_PACKAGE}: reinstall smadrive")


def shipped_file(kind: str, name: str) -> Path:
    """The shipped `configs/<kind>/<name>.toml`; ConfigError names those that exist."""
    folder = configs_dir() / kind
    path = folder / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in folder.glob("*.toml")))
        raise ConfigError(f"'{name}' is neither a .toml file nor one of the shipped {kind}: {known}")
    return path
