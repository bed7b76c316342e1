"""Arguments and options that several commands share. This module imports little, because `off` must start at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PAGE_PORT = 5006
"""The port of a page in the browser, unless the user chooses another one."""

RigFile = Annotated[str, typer.Argument(help="Rig file, or the name of a shipped rig.")]

TraceFolder = Annotated[
    Path | None,
    typer.Option(
        "--trace", metavar="FOLDER", help="Write the traffic on each bus to a file DEVICE.trace in this folder."
    ),
]
