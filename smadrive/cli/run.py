"""`smadrive run`: track a displacement reference."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from math import isfinite, isnan
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.options import RigFile, TraceFolder
from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.run_view import watched
from smadrive.control.feasibility import Feasibility, simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.loop import LoopMetrics
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import SHAPES, parse_reference
from smadrive.errors import ConfigError, TripError
from smadrive.files.atomic import LOG, TABLE, check_output
from smadrive.files.csv_table import read_table
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import Measurement
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.controllers import tracking_settings
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_log import record_tracking, reference_text
from smadrive.runs.run_metrics import TrackingMetrics, tracking_caveats, tracking_metrics, tripped_loop
from smadrive.safety.supervisor import check_thermocouple
from smadrive.wire.identified_wire import load_wire
from smadrive.wire.wire_model import WireModel, WireState, travel_mm

APPROACH_S = 10.0
"""How long the wire takes to come to the beginning of the reference; not scored."""

NOT_ADAPTED = (
    "adapt = true under [feedback] is for `smadrive tune` alone: this run leaves the rules of the model as they are"
)

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
    path = model_file(config, model)
    identified = load_wire(path)
    wanted = read_reference(reference)
    wanted.check_within(travel_mm(identified.model))
    try:
        with Rig(config, trace_folder=trace) as bench:
            wire = WireModel(identified.model, identified.heat_balance or bench.nominal_balance)
            given, rehearsed = _rehearsed(bench, wanted, wire)
            rehearsed.check(config.limits.temperature_max_c, smooth=smooth)
            doubts = [f"{path.name}: {caveat}" for caveat in identified.caveats]
            caveats = (*rehearsed.caveats, *doubts, *([NOT_ADAPTED] if config.feedback.adapt else []))
            _beware(caveats, output)
            loop = _recorded(log_file, bench, wire, given, rehearsed.nearest, caveats, quiet=output.quiet)
    except TripError as trip:
        try:
            _tell(read_log(log_file), None, output, tripped=str(trip))
        finally:
            raise trip  # whatever becomes of what is told, this is how it ended
    _tell(read_log(log_file), loop, output, tripped=None)


def _rehearsed(bench: Rig, wanted: Reference, wire: WireModel) -> tuple[Reference, Feasibility]:
    """What is wanted from where the wire is now, and how near the wire comes to it. Nothing is heated."""
    measured = bench.heater.exchange(0.0)
    check_thermocouple(measured)
    start_mm = start_displacement_mm(wire.model, measured)
    given = wanted.with_approach(start_mm, APPROACH_S)
    bench.check_balance(wire.balance)
    start = WireState(measured.temperature_c, wire.model.initial_state(measured.temperature_c, start_mm))
    return given, simulate_run(given, wire, HysteresisInverse(wire.model), tracking_settings(bench.config), start)


def _recorded(
    log_file: Path,
    bench: Rig,
    wire: WireModel,
    given: Reference,
    nearest: Reference,
    caveats: tuple[str, ...],
    *,
    quiet: bool,
) -> LoopMetrics:
    """Track the reference `nearest` to what was given, logged to `log_file`, shown unless `quiet`. TripError."""
    experiment = nearest, wire.model, wire.balance, HysteresisInverse(wire.model)
    with (
        record_tracking(
            log_file, bench, *experiment, given_reference=reference_text(given), caveats=json.dumps(caveats)
        ) as recorder,
        watched(recorder, "tracking", nearest.duration_s, bench.config.limits.current_max_a, quiet=quiet) as record,
    ):
        return bench.track(*experiment, record)


def _tell(log: Log, loop: LoopMetrics | None, output: Output, *, tripped: str | None) -> None:
    """The figures of the run, to its end or to the trip that cut it."""
    figures = tracking_metrics(log, loop or tripped_loop(log))
    doubts = tracking_caveats(log)
    output.table(HEADER, [table_row("tracking", figures)])
    _beware(doubts, output)
    output.say(f"log: {log.path}")
    output.result({**asdict(figures), "caveats": doubts, "tripped": tripped})


def _beware(caveats: Iterable[str], output: Output) -> None:
    for caveat in caveats:
        output.say(f"beware: {caveat}")


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


def table_row(name: str, figures: TrackingMetrics) -> tuple[str, ...]:
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
