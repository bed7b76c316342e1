"""`smadrive run`: track a displacement reference."""

from __future__ import annotations

import json
from dataclasses import asdict
from math import isfinite, isnan
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.options import RigFile, TraceFolder
from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.announcement import announce
from smadrive.cli.views.run_view import watched
from smadrive.control.feasibility import Feasibility, simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.loop import LoopMetrics
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import SHAPES, parse_reference
from smadrive.errors import ConfigError, TripError
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import read_table
from smadrive.files.kinds import LOG, TABLE
from smadrive.hysteresis import HysteresisModel
from smadrive.measurement import Measurement
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.controllers import tracking_settings
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_log import record_tracking, reference_text
from smadrive.runs.run_metrics import TrackingMetrics, tracking_caveats, tracking_metrics, tripped_loop_metrics
from smadrive.safety.supervisor import check_thermocouple
from smadrive.wire.identified_wire import load_wire
from smadrive.wire.wire_model import WireModel, WireState, travel_mm

APPROACH_S = 10.0
"""Duration of the approach, in which the wire moves to the beginning of the reference. The approach is not scored."""

NOT_ADAPTED = "adapt = true under [feedback] has an effect only in `smadrive tune`: this run does not change the rules"

HEADER = ("", "RMS error", "max error", "trips", "missed deadlines")


def main(
    rig: RigFile,
    reference: Annotated[
        str,
        typer.Option(
            help="CSV (time_s, displacement_mm), or SHAPE:key=value,… as in sine:low_mm=2,high_mm=9,period_s=56. "
            f"Shapes: {', '.join(SHAPES)}; a shape without keys prints its keys."
        ),
    ],
    log_file: Annotated[Path, typer.Option("--log-file", "-o", help="Log (.h5) to write.")],
    model: Annotated[Path | None, typer.Option(help="Model file; the one of the rig file by default.")] = None,
    smooth: Annotated[
        bool,
        typer.Option("--smooth", help="If the wire cannot follow the reference, track the nearest one that it can."),
    ] = False,
    trace: TraceFolder = None,
    as_json: AsJson = False,
) -> None:
    """Track a displacement reference with the wire of RIG, by the inverse of its identified model.

    The run is simulated on the model before the wire is heated. A reference that the wire cannot follow is an error.
    """
    output = Output(as_json)
    check_output(log_file, LOG)
    config = load_rig(rig)
    path = model_file(config, model)
    identified = load_wire(path)
    given = read_reference(reference)
    given.check_within(travel_mm(identified.model))
    try:
        with Rig(config, trace_folder=trace) as open_rig:
            wire = WireModel(identified.model, identified.heat_balance or open_rig.nominal_balance)
            given, simulated = _simulated(open_rig, given, wire)
            simulated.check(config.limits.temperature_max_c, smooth=smooth)
            model_caveats = [f"{path.name}: {caveat}" for caveat in identified.caveats]
            caveats = (*simulated.caveats, *model_caveats, *([NOT_ADAPTED] if config.feedback.adapt else []))
            output.warn(caveats)
            loop = _track(log_file, open_rig, wire, given, simulated.nearest, caveats, output)
    except TripError as trip:
        try:
            _print_metrics(read_log(log_file), None, output, tripped=str(trip))
        finally:
            raise trip  # also when the output cannot be written
    _print_metrics(read_log(log_file), loop, output, tripped=None)


def _simulated(rig: Rig, given: Reference, wire: WireModel) -> tuple[Reference, Feasibility]:
    """Add the approach from the present state of the wire to `given`, and simulate the run. Nothing is heated."""
    measured = rig.measure()
    check_thermocouple(measured)
    start_mm = start_displacement_mm(wire.model, measured)
    given = given.with_approach(start_mm, APPROACH_S)
    rig.check_balance(wire.balance)
    start = WireState(measured.temperature_c, wire.model.initial_state(measured.temperature_c, start_mm))
    return given, simulate_run(given, wire, HysteresisInverse(wire.model), tracking_settings(rig.config), start)


def _track(
    log_file: Path,
    rig: Rig,
    wire: WireModel,
    given: Reference,
    nearest: Reference,
    caveats: tuple[str, ...],
    output: Output,
) -> LoopMetrics:
    """Track `nearest`, the reference nearest to `given` that the wire can follow, and show the run.

    TripError after a trip.
    """
    experiment = nearest, wire.model, wire.balance, HysteresisInverse(wire.model)
    limit_a, given_text = rig.config.limits.current_max_a, reference_text(given)
    with record_tracking(
        log_file, rig, *experiment, given_reference=given_text, caveats=json.dumps(caveats)
    ) as recorder:
        announce(output, log_file, "the run", nearest.duration_s, rig.clock)
        with watched(recorder, "tracking", nearest.duration_s, limit_a, quiet=output.quiet) as record:
            return rig.track(*experiment, record)


def _print_metrics(log: Log, loop: LoopMetrics | None, output: Output, *, tripped: str | None) -> None:
    """Print the metrics of the run up to its end or its trip. `loop` is None after a trip."""
    metrics = tracking_metrics(log, loop or tripped_loop_metrics(log))
    caveats = tracking_caveats(log)
    output.table(HEADER, [table_row("tracking", metrics)])
    output.warn(caveats)
    output.say(f"log: {log.path}")
    output.result({**asdict(metrics), "caveats": caveats, "tripped": tripped})


def start_displacement_mm(model: HysteresisModel, measured: Measurement) -> float:
    """Return the measured displacement. Without a sensor, return that of the model for a wire that was cold before."""
    if isfinite(measured.displacement_mm):
        return measured.displacement_mm
    return model.initial_state(measured.temperature_c).y


def read_reference(text: str) -> Reference:
    """Return the reference in a CSV file, or that of a text such as `sine:low_mm=2,high_mm=9,period_s=56`."""
    path = Path(text)
    if TABLE.has_ending(path) or path.is_file():
        table = read_table(path)
        return Reference.from_samples(table.column("time_s"), table.column("displacement_mm"))
    return parse_reference(text)


def table_row(name: str, metrics: TrackingMetrics) -> tuple[str, ...]:
    """Return a row of the table of metrics. `HEADER` names its columns."""
    return (
        name,
        _percent(metrics.rms_percent),
        _percent(metrics.max_percent),
        str(metrics.trips),
        str(metrics.missed_deadlines),
    )


def _percent(value: float) -> str:
    return "unknown" if isnan(value) else f"{value:.2f} %"


def model_file(config: RigConfig, option: Path | None) -> Path:
    """Return the model file that the option names, or that the rig file names. ConfigError without either name."""
    if option is not None:
        return option
    if config.model is None:
        raise ConfigError(
            "the rig file names no model",
            where=f"rig '{config.name}'",
            cure="excite and identify its wire, then pass --model or set model in the rig file",
        )
    return Path(config.model)
