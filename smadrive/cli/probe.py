"""`smadrive probe`: check the identity of every device of a rig, and show live values."""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.parsing.options import RigFile, TraceFolder
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.health_view import show_health
from smadrive.measurement import Measurement
from smadrive.rig.calibration.description import descriptions, today
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.supervision import unexpected_current
from smadrive.rig.switching_off.guardians import notes_waiting_guardians, waiting_guardians
from smadrive.runs.health.assessment import assess, health_values
from smadrive.wire.cold_wire import cold_wire_caveats


def main(
    rig: RigFile,
    model: Annotated[
        Path | None, typer.Option(help="Model file whose wire is assessed; by default the model of the rig file.")
    ] = None,
    trace: TraceFolder = None,
    as_json: AsJson = False,
) -> None:
    """Connect to RIG, check the identity of every device, show live values and the drift of the wire.

    The heater stays off.
    """
    output = Output(as_json)
    config = load_rig(rig)
    with notes_waiting_guardians(), Rig(config, trace_folder=trace) as open_rig:
        measurement = open_rig.measure()
        identities = {name: str(identity) for name, identity in open_rig.identify().items()}
        tripped = open_rig.latch.read()
        bus = open_rig.bus_counters
        measured = tuple(filter(open_rig.measures, ("temperature", "displacement")))
        wire_file = model or _model_file(config)
        found = None if wire_file is None else assess(wire_file, config.feedback)
    waiting = waiting_guardians()
    caveats = (
        *filter(None, [unexpected_current(config, measurement)]),
        *open_rig.caveats,
        *cold_wire_caveats(measurement.temperature_c, open_rig.data_sheet.ambient_c),
    )
    for name, identity in identities.items():
        output.say(f"{config.name}: {name} is of type {identity}")
    output.table(("quantity", "value"), _rows(measurement, measured))
    calibrated = descriptions(config.calibration, today())
    for quantity in measured:
        output.say(f"{config.name}: {calibrated[quantity]}")
    if found is not None:
        show_health(output, found)
    for name, counters in bus.items():
        if counters.failures:
            output.say(f"{config.name}: bus of {name}: {counters}")
    output.warn(caveats)
    _print_latched(output, measurement, tripped, rig)
    for guardian in waiting:
        output.say(guardian)
    output.result(
        {
            "rig": config.name,
            "devices": identities,
            **measurement._asdict(),
            "calibration": config.calibration.model_dump(mode="json"),
            "bus": {name: asdict(counters) for name, counters in bus.items()},
            "caveats": caveats,
            "tripped": tripped,
            "waiting_guardians": waiting,
            "wire": None if found is None else health_values(found),
        }
    )


def _model_file(config: RigConfig) -> Path | None:
    """Return the model file that the rig file names; None if it names none, or if the model file does not exist."""
    return Path(config.model) if config.model is not None and os.path.isfile(config.model) else None


def _print_latched(output: Output, measurement: Measurement, tripped: str | None, rig: str) -> None:
    """Print the latched faults of the device and the latched trip (`tripped`), and how to clear them."""
    latched = [*(f"{name} (on the device)" for name in measurement.device_faults), *filter(None, [tripped])]
    for fault in latched:
        output.say(f"latched: {fault}")
    if latched:
        output.say(f"hint: remove the cause, then run smadrive off {shlex.quote(rig)} --clear-faults")


def _rows(measurement: Measurement, measured: Collection[str]) -> list[tuple[str, str]]:
    """Return the rows of the table. A missing displacement, fault or limit has a row, too.

    `measured` are the quantities that a device of the rig measures.
    """
    facts = dict(measurement.facts())
    displacement = "no sensor, or out of its range" if "displacement" in measured else "not measured"
    if isfinite(measurement.displacement_mm):
        displacement = facts["displacement"]
    return [
        ("temperature", facts["temperature"]),
        ("displacement", displacement),
        ("heater current", facts["current"]),
        ("heater voltage", facts["voltage"]),
        ("faults", facts.get("faults", "none")),
        ("limited by", facts.get("limited by", "nothing")),
    ]
