"""`smadrive excite`: the identification experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from smadrive.cli.live.publishing import Publish, RunPublication, run_publication
from smadrive.cli.parsing.options import RigFile, TraceFolder
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.announcement import announced, log_named_at_interruption, metrics_after_trip
from smadrive.cli.views.run_view import shown
from smadrive.control.loop import LoopMetrics
from smadrive.display.number_text import count_text
from smadrive.files.atomic import check_output
from smadrive.files.kinds import LOG
from smadrive.identification.excitation import Excitation
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import excite, plan_excitation
from smadrive.runs.health.recording import health_recorded
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.metrics.run import tripped_loop_metrics
from smadrive.runs.run_metadata import excitation_of


def main(
    rig: RigFile,
    log_file: Annotated[Path, typer.Option("--log-file", "-o", help="Log (.h5) to write.")],
    trace: TraceFolder = None,
    publish: Publish = None,
    as_json: AsJson = False,
) -> None:
    """Run the identification experiment of RIG, within its limits, and record it. The wire is heated."""
    output = Output(as_json)
    check_output(log_file, LOG)
    config = load_rig(rig)

    def print_metrics(tripped: str | None = None) -> None:
        _print_metrics(read_log(log_file), loop, output, publication.result(), tripped=tripped)

    loop = None
    with (
        metrics_after_trip(print_metrics),
        log_named_at_interruption(log_file, "the experiment"),
        health_recorded(log_file, output.warn),
        run_publication(publish, config, "excite", output) as publication,
        Rig(config, trace_folder=trace) as open_rig,
    ):
        publication.begin(open_rig)
        loop = _excite(log_file, open_rig, plan_excitation(open_rig), output, publication)
    print_metrics()


def _excite(
    log_file: Path, rig: Rig, excitation: Excitation, output: Output, publication: RunPublication
) -> LoopMetrics:
    """Excite the wire, record the run in `log_file`, show it and publish it. Return the metrics of the loop.

    TripError after a trip.
    """
    watch = publication.watch(shown("exciting", rig.config.limits.current_max_a, quiet=output.quiet))
    announced_watch = announced(output, log_file, "the experiment", rig.clock, watch, excitation)
    return excite(log_file, rig, excitation, announced_watch)


def _print_metrics(
    log: Log, loop: LoopMetrics | None, output: Output, published: dict[str, Any], *, tripped: str | None
) -> None:
    """Print the metrics of the experiment up to its end or its trip. `loop` is None after a trip."""
    metrics, excitation = loop or tripped_loop_metrics(log), excitation_of(log)
    samples, missed = count_text(metrics.ticks, "sample"), count_text(metrics.missed_deadlines, "missed deadline")
    ended = "the heater is off" if tripped is None else "then the run tripped"
    caveats = run_caveats(log)
    output.warn(caveats)
    output.say(f"{log.path}: {samples}, {missed}; {ended}")
    output.result(
        {
            "ticks": metrics.ticks,
            "missed_deadlines": metrics.missed_deadlines,
            "trips": metrics.trips,
            "log_file": str(log.path),
            "caveats": caveats,
            "tripped": tripped,
            "plan": excitation.plan,
            "reversal_curves": excitation.reversal_curves,
            "duration_s": excitation.duration_s,
            **published,
        }
    )
