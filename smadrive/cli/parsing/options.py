"""Arguments and options that several commands share. This module imports little, because `off` must start at once."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smadrive.errors import ConfigError

if TYPE_CHECKING:
    from smadrive.rig.config import RigConfig

PAGE_PORT = 5006
"""The port of a page in the browser, unless the user chooses another one."""

RigFile = Annotated[str, typer.Argument(help="Rig file, or the name of a shipped rig.")]

ModelFile = Annotated[Path | None, typer.Option(help="Model file; by default the model of the rig file.")]

TraceFolder = Annotated[
    Path | None,
    typer.Option(
        "--trace", metavar="FOLDER", help="Write the traffic on each bus to a file DEVICE.trace in this folder."
    ),
]


def model_file(config: RigConfig, option: Path | None) -> Path:
    """Return the model file that `option` names, or else the model file of the rig. ConfigError if both are missing."""
    if option is not None:
        return option
    if config.model is None:
        raise ConfigError(
            "the rig file names no model",
            where=f"rig '{config.name}'",
            cure="make one with `smadrive excite` and `smadrive identify`, then give --model FILE, or write "
            'model = "FILE" into the rig file',
        )
    return Path(config.model)
