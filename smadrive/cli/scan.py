"""`smadrive scan`: who is on this line?"""

from __future__ import annotations

from typing import Annotated

import typer

from smadrive.cli.output import AsJson, Output
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.scan import FoundDevice, scan
from smadrive.errors import ConfigError, DeviceError
from smadrive.files.number_text import parse_whole
from smadrive.files.shipped import configs_dir
from smadrive.modbus.transports.transport import SerialSettings

Port = Annotated[
    str, typer.Argument(help="serial:///dev/ttyUSB0, tcp://host:502 or rtu+tcp://host:port", metavar="PORT")
]
Units = Annotated[str, typer.Option(help="Unit ids to ask, as in 1-10 or 1,3,7.", metavar="IDS")]

HEADER = ("unit id", "line", "profile")


def main(port: Port, units: Units = "1-10", as_json: AsJson = False) -> None:
    """Ask every unit on PORT who it is, and name the profiles that match. Nothing is written to any device."""
    output = Output(as_json)
    unit_ids = unit_ids_of(units)
    profiles = [load_profile(file) for file in sorted((configs_dir() / "devices").glob("*.toml"))]
    with output.progress() as progress:
        task = progress.add_task("asking", total=None)
        found = list(
            scan(
                port,
                unit_ids,
                profiles,
                lambda line, unit_id: progress.update(task, description=f"asking unit {unit_id} {line}"),
            )
        )
    if not found:
        raise DeviceError(
            f"{port}: none of the units {units} answers: are they powered, wired A to A, and set to Modbus?"
        )
    output.table(
        HEADER, [("" if one.unit_id is None else str(one.unit_id), _line(one.line), _profile(one)) for one in found]
    )
    for one in found:
        if one.proved:
            output.say(
                f'[[devices]]\nname = "{one.proved[0]}"\nprofile = "{one.proved[0]}"\nurl = "{_url(port, one.line)}"'
            )
            if one.unit_id is not None:
                output.say(f"unit_id = {one.unit_id}\n")
    output.result({"port": port, "devices": [_as_json(one, port) for one in found]})


def unit_ids_of(text: str) -> list[int]:
    """The numbers of `1-10` or `1,3,7`; ConfigError when they are none."""
    try:
        spans = [part.partition("-") for part in text.split(",")]
        ends = [(parse_whole(first), parse_whole(last or first)) for first, _, last in spans]
    except ValueError:
        ends = []
    unit_ids = [unit for first, last in ends if 0 <= first <= last <= 255 for unit in range(first, last + 1)]
    if not unit_ids or not all(0 <= first <= last <= 255 for first, last in ends):
        raise ConfigError(f"--units {text}: write unit ids of 0 to 255, as in 1-10 or 1,3,7")
    return unit_ids


def _profile(found: FoundDevice) -> str:
    if found.proved:
        return " or ".join(found.proved)
    maybe = " or ".join(found.possible)
    return f"perhaps {maybe} (nothing on these devices proves it)" if maybe else "none of the shipped profiles"


def _line(line: SerialSettings | None) -> str:
    return "" if line is None else f"{line.baudrate} 8{line.parity}{line.stopbits}"


def _url(port: str, line: SerialSettings | None) -> str:
    return port if line is None else f"{port}?baudrate={line.baudrate}&parity={line.parity}&stopbits={line.stopbits}"


def _as_json(found: FoundDevice, port: str) -> dict[str, object]:
    return {
        "unit_id": found.unit_id,
        "url": _url(port, found.line),
        "profiles": list(found.proved),
        "possible": list(found.possible),
    }
