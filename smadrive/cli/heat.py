"""`smadrive heat`: hold a current or a temperature for a time, supervised and recorded."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from smadrive.cli.live.publishing import Publish, run_publication
from smadrive.cli.parsing.options import RigFile, TraceFolder
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.announcement import announced, log_named_at_interruption, metrics_after_trip
from smadrive.cli.views.run_view import shown
from smadrive.control.controllers.step import ManualStep
from smadrive.control.loop import LoopMetrics
from smadrive.display.number_text import quantity
from smadrive.files.atomic import check_output, unused_record
from smadrive.files.kinds import LOG
from smadrive.rig.checks.limits import check_step
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import heat, planned_step_caveats
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.run import tripped_loop_metrics
from smadrive.runs.metrics.step import StepMetrics, step_caveats, step_metrics


def main(
    rig: RigFile,
    duration_s: Annotated[float, typer.Option("--for", help="Length of the step, in s.")],
    current_a: Annotated[float | None, typer.Option("--current", help="Current to hold, in A.")] = None,
    temperature_c: Annotated[float | None, typer.Option("--temperature", help="Temperature to hold, in °C.")] = None,
    log_file: Annotated[
        Path | None, typer.Option("--log-file", "-o", help="Log (.h5) to write; heat.h5, heat-2.h5, … by default.")
    ] = None,
    trace: TraceFolder = None,
    publish: Publish = None,
    as_json: AsJson = False,
) -> None:
    """Hold a current or a temperature of the wire of RIG for a time, within its limits, and record it.

    This step is supervised like every run, and ends at zero current. Give either --current or --temperature.
    """
    output = Output(as_json)
    step = ManualStep(current_a, temperature_c, duration_s)
    log_file = log_file or unused_record("heat", LOG)
    check_output(log_file, LOG)
    closed_rig = Rig(load_rig(rig), trace_folder=trace)
    check_step(step, closed_rig.config, closed_rig.data_sheet)

    def print_metrics(tripped: str | None = None) -> None:
        _print_metrics(read_log(log_file), step, loop, output, publication.result(), tripped=tripped)

    loop = None
    with (
        metrics_after_trip(print_metrics),
        log_named_at_interruption(log_file, "the step"),
        run_publication(publish, closed_rig.config, "heat", output) as publication,
        closed_rig as open_rig,
    ):
        output.warn(planned_step_caveats(open_rig, step))
        publication.begin(open_rig)
        watch = publication.watch(shown(f"heating, {step}", open_rig.config.limits.current_max_a, quiet=output.quiet))
        loop = heat(log_file, open_rig, step, announced(output, log_file, "the step", open_rig.clock, watch))
    print_metrics()


def _print_metrics(
    log: Log,
    step: ManualStep,
    loop: LoopMetrics | None,
    output: Output,
    published: dict[str, Any],
    *,
    tripped: str | None,
) -> None:
    """Print the metrics of the step up to its end or its trip. `loop` is None after a trip."""
    loop = loop or tripped_loop_metrics(log)
    metrics, caveats = step_metrics(log), step_caveats(log)
    output.table(("quantity", "value"), _rows(metrics))
    output.warn(caveats)
    output.say(f"log: {log.path}" + ("; the heater is off" if tripped is None else "; the step tripped"))
    output.result(
        {
            **asdict(step),
            **asdict(metrics),
            "ticks": loop.ticks,
            "missed_deadlines": loop.missed_deadlines,
            "trips": loop.trips,
            "log_file": str(log.path),
            "caveats": (*log.parsed("caveats", tuple), *caveats),
            "tripped": tripped,
            **published,
        }
    )


def _rows(metrics: StepMetrics) -> list[tuple[str, str]]:
    return [
        ("temperature at the end", quantity(metrics.temperature_end_c, 2, "°C")),
        ("highest temperature", quantity(metrics.temperature_max_c, 2, "°C")),
        ("displacement at the end", quantity(metrics.displacement_end_mm, 4, "mm")),
        ("current at the end", quantity(metrics.current_end_a, 4, "A")),
        ("resistance at the end", quantity(metrics.resistance_end_ohm, 3, "Ω")),
        ("electrical energy", quantity(metrics.energy_j, 1, "J")),
    ]
