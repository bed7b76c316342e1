"""`smadrive scan`: find the devices on a line."""

from __future__ import annotations

from typing import Annotated

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.errors import ConfigError, DeviceError
from smadrive.files.number_text import parse_whole
from smadrive.rig.ports.discovery import DiscoveredDevice, discover, rig_entries

Port = Annotated[str, typer.Argument(help="/dev/ttyUSB0, tcp://host:502 or rtu+tcp://host:port", metavar="PORT")]
Units = Annotated[str, typer.Option(help="Unit ids to ask, as in 1-10 or 1,3,7.", metavar="IDS")]

HEADER = ("unit id", "line", "profile")


def main(port: Port, units: Units = "1-10", as_json: AsJson = False) -> None:
    """Ask the units on PORT for their identity, and name the profiles that match. Nothing is written to any device."""
    output = Output(as_json)
    devices = _discovered(port, units, output)
    if not devices:
        raise DeviceError(
            f"none of the units {units} answers",
            where=port,
            cure="check that the devices are powered, wired A to A and B to B, and set to Modbus; try other --units",
        )
    output.table(HEADER, [_row(device) for device in devices])
    for entry in rig_entries(devices):
        output.say(entry)
    output.result({"port": port, "devices": [_result(device) for device in devices]})


def _discovered(port: str, units: str, output: Output) -> list[DiscoveredDevice]:
    unit_ids = unit_ids_of(units)
    with output.progress("opening the port") as progress:
        (task,) = progress.task_ids

        def show(line: str, unit_id: int) -> None:
            progress.update(task, description=f"asking unit {unit_id}{line and ', '}{line}")

        return discover(port, unit_ids, show)


def unit_ids_of(text: str) -> list[int]:
    """Return the unit ids in a text such as `1-10` or `1,3,7`.

    ConfigError for a text of another form, for a falling range, and for an id above 255.
    """
    try:
        ranges = [part.partition("-") for part in text.split(",")]
        ends = [(parse_whole(first), parse_whole(last or first)) for first, _, last in ranges]
    except ValueError:
        ends = []
    if not ends or not all(0 <= first <= last <= 255 for first, last in ends):
        raise ConfigError(
            "not a list of unit ids",
            where="--units",
            value=text,
            cure="write numbers from 0 to 255, as in 1-10 or 1,3,7",
        )
    return [unit_id for first, last in ends for unit_id in range(first, last + 1)]


def _row(device: DiscoveredDevice) -> tuple[str, str, str]:
    unit_id = "" if device.unit_id is None else str(device.unit_id)
    possible = " or ".join(device.possible)
    unproved = f"perhaps {possible} (no register proves it)" if possible else "none of the shipped profiles"
    return unit_id, device.line, " or ".join(device.proved) or unproved


def _result(device: DiscoveredDevice) -> dict[str, object]:
    return {
        "unit_id": device.unit_id,
        "url": device.url,
        "profiles": list(device.proved),
        "possible": list(device.possible),
    }
