"""`smadrive board check`: check an `sma-reference` board on the desk."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from smadrive.cli.output import AsJson, Output
from smadrive.rig.ports.board_check import check_board_at, error_of

Port = Annotated[str, typer.Argument(help="/dev/ttyUSB0 or rtu+tcp://host:port", metavar="PORT")]

HEADER = ("check", "result", "seen")


class BoardAction(StrEnum):
    """What to do with the board."""

    CHECK = "check"


def main(
    action: Annotated[BoardAction, typer.Argument(help="check: conformance and safety.", metavar="check")],  # noqa: ARG001
    port: Port,
    as_json: AsJson = False,
) -> None:
    """Check the board on PORT: the frames of its specification, and the safety checks that need no wire.

    Disconnect the wire, and connect the thermocouple. The check arms the board for moments, with at most 60 mA. The
    exit code is 3 if the board answers wrongly, and 4 if it fails a safety check.
    """
    output = Output(as_json)
    results = []
    with output.progress("checking the board") as progress:
        (task,) = progress.task_ids
        for result in check_board_at(port):
            results.append(result)
            progress.update(task, description=result.name)
    output.table(HEADER, [(one.name, one.verdict, one.detail) for one in results], notes=True)
    output.result({"port": port, "checks": [one._asdict() for one in results]})
    if (error := error_of(results, port)) is not None:
        raise error
