"""`smadrive run`: track a displacement reference."""

from __future__ import annotations

import json
from dataclasses import asdict
from math import isfinite, isnan
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.live import watched
from smadrive.cli.output import AsJson, Output
from smadrive.cli.probe import RigFile, TraceFolder
from smadrive.control.feedforward import HysteresisInverse
from smadrive.control.reference import SHAPES, Reference, parse_reference
from smadrive.control.rehearsal import rehearse
from smadrive.control.supervisor import check_thermocouple
from smadrive.control.wire import WireModel, WireState, travel_mm
from smadrive.controllers import tracking_settings
from smadrive.errors import ConfigError
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import Measurement
from smadrive.outfile import LOG, TABLE, check_output
from smadrive.rig import Rig
from smadrive.rigconfig import RigConfig, load_rig
from smadrive.runfigures import TrackingFigures, tracking_caveats, tracking_figures
from smadrive.runlog import record_tracking, reference_text
from smadrive.telemetry.log import read_log
from smadrive.telemetry.table import read_table
from smadrive.wirefile import load_wire_file

APPROACH_S = 10.0
"""How long the wire takes to come to the beginning of the reference; not scored."""

HEADER = ("", "RMS error", "max error", "trips", "missed deadlines")


def main(
    rig: RigFile,
    reference: Annotated[
        str,
        typer.Option(
            help="CSV (time_s, displacement_mm), or SHAPE:key=value,… as in sine:low_mm=2,high_mm=9,period_s=56. "
            f"Shapes: {', '.join(SHAPES)}; one without keys tells its keys."
        ),
    ],
    log_file: Annotated[Path, typer.Option("--log-file", "-o", help="Log (.h5) to write.")],
    model: Annotated[Path | None, typer.Option(help="Model file; that of the rig file by default.")] = None,
    smooth: Annotated[
        bool,
        typer.Option("--smooth", help="Run the nearest reference that the wire can follow, if it cannot this one."),
    ] = False,
    trace: TraceFolder = None,
    as_json: AsJson = False,
) -> None:
    """Make the wire of RIG follow a displacement reference, with the inverse of its identified model.

    The reference is rehearsed on the model before anything is heated; what the wire cannot do is refused.
    """
    output = Output(as_json)
    check_output(log_file, LOG)
    config = load_rig(rig)
    hysteresis, balance = load_wire_file(model_file(config, model))
    wanted = read_reference(reference)
    wanted.check_within(travel_mm(hysteresis))
    with Rig(config, trace_folder=trace) as bench:
        measured = bench.heater.exchange(0.0)
        check_thermocouple(measured)
        start_mm = start_displacement_mm(hysteresis, measured)
        path = wanted.with_approach(start_mm, APPROACH_S)
        wire = WireModel(hysteresis, balance or bench.nominal_balance)
        bench.check_balance(wire.balance)
        start = WireState(measured.temperature_c, hysteresis.initial_state(measured.temperature_c, start_mm))
        rehearsed = rehearse(path, wire, HysteresisInverse(hysteresis), tracking_settings(config), start)
        rehearsed.check(config.limits.temperature_max_c, smooth=smooth)
        for caveat in rehearsed.caveats:
            output.say(f"beware: {caveat}")
        experiment = rehearsed.nearest, hysteresis, wire.balance, HysteresisInverse(hysteresis)
        with (
            record_tracking(
                log_file,
                bench,
                *experiment,
                given_reference=reference_text(path),
                caveats=json.dumps(rehearsed.caveats),
            ) as recorder,
            watched(
                recorder,
                "tracking",
                rehearsed.nearest.duration_s,
                config.limits.current_max_a,
                quiet=output.quiet,
            ) as record,
        ):
            loop = bench.track(*experiment, record)
    log = read_log(log_file)
    figures, doubts = tracking_figures(log, loop), tracking_caveats(log)
    output.table(HEADER, [table_row("tracking", figures)])
    for caveat in doubts:
        output.say(f"beware: {caveat}")
    output.say(f"log: {log_file}")
    output.result({**asdict(figures), "caveats": doubts})


def start_displacement_mm(model: HysteresisModel, measured: Measurement) -> float:
    """Where the wire is: as measured, or else as the model has it for a wire that was cold before."""
    if isfinite(measured.displacement_mm):
        return measured.displacement_mm
    return model.initial_state(measured.temperature_c).y


def read_reference(text: str) -> Reference:
    """The reference of a CSV file, or of a one-line form."""
    path = Path(text)
    if TABLE.names(path) or path.is_file():
        table = read_table(path)
        return Reference.from_samples(table.column("time_s"), table.column("displacement_mm"))
    return parse_reference(text)


def table_row(name: str, figures: TrackingFigures) -> tuple[str, ...]:
    """One line of the table of figures."""
    return (
        name,
        _percent(figures.rms_percent),
        _percent(figures.max_percent),
        str(figures.trips),
        str(figures.missed_deadlines),
    )


def _percent(value: float) -> str:
    return "unknown" if isnan(value) else f"{value:.2f} %"


def model_file(config: RigConfig, option: Path | None) -> Path:
    """The model file of the option, or else of the rig file; ConfigError when neither names one."""
    if option is not None:
        return option
    if config.model is None:
        raise ConfigError(
            f"rig '{config.name}' names no model: excite and identify its wire, "
            "then pass --model or set model in the rig file"
        )
    return Path(config.model)
