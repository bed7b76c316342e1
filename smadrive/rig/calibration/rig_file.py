"""Storage of a calibration in the rig file. The comments and the order of the file stay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomlkit

from smadrive.devices.calibration import CalibrationConfig
from smadrive.errors import ConfigError
from smadrive.files.atomic import replacing
from smadrive.files.config import validate
from smadrive.files.shipped import is_shipped


def check_own_file(path: Path) -> None:
    """Raise ConfigError when `path` is a shipped rig file: all users share it, so it cannot hold a calibration."""
    if is_shipped(path):
        raise ConfigError(
            "a shipped rig file is not changed",
            where=path.name,
            cure=f"copy the file (`cp {path} my-rig.toml`), then calibrate with the copy",
        )


def store_calibration(path: Path, quantity: str, values: dict[str, Any]) -> None:
    """Write `values` as the section [calibration.QUANTITY] of the rig file, in place of an earlier one.

    ConfigError when offset or scale are outside the limits of a working sensor; DataError when the file cannot be
    written. In both cases the file stays as it is.
    """
    try:
        validate({quantity: values}, CalibrationConfig, where=str(path))
    except ConfigError as error:
        raise ConfigError(
            f"no working {quantity} sensor has this calibration, so it is not stored",
            where=path,
            value=error.what,
            cure="check type and wiring of the sensor, and that the sensor was at the known value",
        ) from None
    document = tomlkit.parse(path.read_text(encoding="utf-8-sig"))
    section = document.setdefault("calibration", tomlkit.table(is_super_table=True))
    section[quantity] = values
    with replacing(path) as partial:
        partial.write_text(tomlkit.dumps(document), encoding="utf-8")
