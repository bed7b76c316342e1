"""`smadrive run`: track a displacement reference."""

from __future__ import annotations

from dataclasses import asdict
from math import isnan
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.options import RigFile, TraceFolder
from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.announcement import announced
from smadrive.cli.views.run_view import shown
from smadrive.control.loop import LoopMetrics
from smadrive.control.references.shapes import SHAPES
from smadrive.errors import ConfigError, TripError
from smadrive.files.atomic import check_output
from smadrive.files.kinds import LOG
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import plan_tracking, read_reference, track
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.run_metrics import TrackingMetrics, tracking_caveats, tracking_metrics, tripped_loop_metrics
from smadrive.wire.identified_wire import load_wire
from smadrive.wire.wire_model import travel_mm

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
            plan = plan_tracking(open_rig, given, identified, smooth=smooth, smooth_option="--smooth")
            output.warn(plan.caveats)
            watch = shown("tracking", config.limits.current_max_a, quiet=output.quiet)
            loop = track(log_file, open_rig, plan, announced(output, log_file, "the run", open_rig.clock, watch))
    except TripError as trip:
        try:
            _print_metrics(read_log(log_file), None, output, tripped=str(trip))
        finally:
            raise trip  # also when the output cannot be written
    _print_metrics(read_log(log_file), loop, output, tripped=None)


def _print_metrics(log: Log, loop: LoopMetrics | None, output: Output, *, tripped: str | None) -> None:
    """Print the metrics of the run up to its end or its trip. `loop` is None after a trip."""
    metrics = tracking_metrics(log, loop or tripped_loop_metrics(log))
    caveats = tracking_caveats(log)
    output.table(HEADER, [table_row("tracking", metrics)])
    output.warn(caveats)
    output.say(f"log: {log.path}")
    output.result({**asdict(metrics), "caveats": caveats, "tripped": tripped})


def table_row(name: str, metrics: TrackingMetrics) -> tuple[str, ...]:
    """Return the row of a run in the table of metrics. `HEADER` names the columns."""
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
    """Return the model file that `option` names, or else the one of the rig file. ConfigError if both are missing."""
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
