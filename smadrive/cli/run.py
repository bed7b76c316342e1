"""`smadrive run`: track a displacement reference, once or many times."""

from __future__ import annotations

import shlex
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from smadrive.cli.live.publishing import Publish, run_publication
from smadrive.cli.parsing.options import ModelFile, RigFile, TraceFolder, model_file
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.announcement import announced, log_named_at_interruption, metrics_after_trip
from smadrive.cli.views.metrics_table import HEADER, table_row
from smadrive.cli.views.run_view import shown
from smadrive.control.loop import LoopMetrics
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import SHAPES
from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.kinds import LOG
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.cycling.continuation import continuation_of
from smadrive.runs.cycling.cycle_table import CYCLE_HEADER, cycle_rows, thinned
from smadrive.runs.cycling.cycles import Cycling, cycles_of, cycling_of
from smadrive.runs.experiments import read_reference, track
from smadrive.runs.health.recording import health_recorded
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.caveats import measured_caveats, sample_caveats, tracking_caveats
from smadrive.runs.metrics.run import tracking_metrics, tripped_loop_metrics
from smadrive.runs.tracking_plan import RETURN_S, PlannedTracking, check_reach, plan_tracking
from smadrive.wire.identified_wire import IdentifiedWire, load_wire

MOST_CYCLES = 20
"""Largest number of cycles in the table on the terminal; the report and `--json` have more."""


class _Options(NamedTuple):
    """The options that describe the experiment."""

    reference: str | None
    model: Path | None
    repeat: int | None
    displacement_from: DisplacementFrom | None


class _Experiment(NamedTuple):
    """The experiment that the options, or the log of a run to resume, describe."""

    reference: Reference
    wire: IdentifiedWire
    cycling: Cycling | None
    caveats: tuple[str, ...] = ()
    displacement_from: DisplacementFrom | None = None


ReferenceOption = Annotated[
    str | None,
    typer.Option(
        help="CSV (time_s, displacement_mm), or SHAPE:key=value,… as in sine:low_mm=2,high_mm=9,period_s=56. "
        f"Shapes: {', '.join(SHAPES)}; a shape without keys prints its keys.  [required without --resume]"
    ),
]

Smooth = Annotated[
    bool,
    typer.Option(
        "--smooth",
        help="If the wire cannot follow the reference, track the nearest feasible reference; also with --resume.",
    ),
]

Source = Annotated[
    DisplacementFrom | None,
    typer.Option(help="Source of the displacement, instead of that in the rig file or in the log of --resume."),
]


def main(
    rig: RigFile,
    log_file: Annotated[Path, typer.Option("--log-file", "-o", help="Log (.h5) to write.")],
    reference: ReferenceOption = None,
    model: ModelFile = None,
    smooth: Smooth = False,
    repeat: Annotated[
        int | None, typer.Option(min=1, help="Repeat the reference this number of times, and measure every cycle.")
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Log of a run with --repeat that ended early: run its remaining cycles.")
    ] = None,
    displacement_from: Source = None,
    trace: TraceFolder = None,
    publish: Publish = None,
    as_json: AsJson = False,
) -> None:
    """Track a displacement reference with the wire of RIG, by the inverse of its identified model.

    The run is simulated on the model before the wire is heated. A reference that the wire cannot follow is an error.
    --resume takes reference, model, number of cycles and source of the displacement from a log, and does not change
    this log. The other options apply to the remaining cycles.
    """
    output = Output(as_json)
    check_output(log_file, LOG)
    config = load_rig(rig)
    options = _Options(reference, model, repeat, displacement_from)
    experiment = _given(config, options) if resume is None else _resumed(resume, config, options)
    if experiment.cycling is not None and experiment.cycling.continues:
        output.say(_resumed_text(experiment.cycling, smooth=smooth))
    rest = "" if experiment.cycling is None else _rest_text(rig, log_file)

    def print_metrics(tripped: str | None = None) -> None:
        _print_metrics(read_log(log_file), loop, output, publication.result(), tripped=tripped)

    loop = None
    with (
        metrics_after_trip(print_metrics),
        log_named_at_interruption(log_file, "the run", rest),
        health_recorded(log_file, output.warn),
        run_publication(publish, config, "run", output) as publication,
        Rig(config, trace_folder=trace) as open_rig,
    ):
        publication.begin(open_rig)
        plan = _planned(open_rig, experiment, smooth=smooth)
        output.warn(plan.caveats)
        watch = publication.watch(shown("tracking", config.limits.current_max_a, quiet=output.quiet))
        loop = track(log_file, open_rig, plan, announced(output, log_file, "the run", open_rig.clock, watch))
    print_metrics()


def _given(config: RigConfig, options: _Options) -> _Experiment:
    """Return the experiment that the options describe. ConfigError without a reference."""
    if options.reference is None:
        cure = "give a CSV or a shape, or the log of a run to --resume"
        raise ConfigError("is missing", where="--reference", cure=cure)
    identified = load_wire(model_file(config, options.model))
    given = read_reference(options.reference)
    check_reach(given, identified)
    if options.repeat is None:
        return _Experiment(given, identified, None, displacement_from=options.displacement_from)
    repeated = given.repeated(options.repeat, RETURN_S)
    back_s = repeated.cycle_s - given.cycle_s
    caveats = (f"the reference does not end where it begins: every cycle has a way back of {back_s:g} s",)
    return _Experiment(given, identified, Cycling(options.repeat), caveats if back_s else (), options.displacement_from)


def _resumed(resume: Path, config: RigConfig, options: _Options) -> _Experiment:
    """Return the experiment that completes the run in the log `resume`.

    ConfigError for an option that the log already determines.
    """
    determined = {"--reference": options.reference, "--model": options.model, "--repeat": options.repeat}
    for option, value in determined.items():
        if value is not None:
            what, cure = "does not go with --resume, which continues what its log holds", "leave the option out"
            raise ConfigError(what, where=option, value=value, cure=cure)
    return _Experiment(*continuation_of(resume, config, options.displacement_from))


def _planned(rig: Rig, experiment: _Experiment, *, smooth: bool) -> PlannedTracking:
    """Return the plan of the run, simulated on the model. Its caveats include those of the experiment."""
    plan = plan_tracking(
        rig,
        experiment.reference,
        experiment.wire,
        smooth=smooth,
        smooth_option="--smooth",
        cycling=experiment.cycling,
        displacement_from=experiment.displacement_from,
    )
    return replace(plan, caveats=(*experiment.caveats, *plan.caveats))


def _resumed_text(cycling: Cycling, *, smooth: bool) -> str:
    """Return the line that says which cycles a resumed run does, and whether `--smooth` applies to them."""
    first = len(cycling.before) + 1
    applied = "; --smooth applies to them" if smooth else ""
    return f"resuming {cycling.continues}: cycles {first} to {cycling.total} of its reference{applied}"


def _rest_text(rig: str, log_file: Path) -> str:
    """Return the end of the sentence about an interrupted run: the command that runs the remaining cycles."""
    resume = f"smadrive run {shlex.quote(rig)} --resume {shlex.quote(str(log_file))} -o NEW.h5"
    return f"; do the remaining cycles with {resume}"


def _print_metrics(
    log: Log, loop: LoopMetrics | None, output: Output, published: dict[str, Any], *, tripped: str | None
) -> None:
    """Print the metrics of the run up to its end or its trip. `loop` is None after a trip.

    The caveats of the plan were printed before the run. They are not printed again, but the JSON object holds them.
    """
    metrics, cycles, cycling = tracking_metrics(log, loop or tripped_loop_metrics(log)), cycles_of(log), cycling_of(log)
    output.table(HEADER, [table_row("tracking", metrics)])
    if cycles:
        output.table(CYCLE_HEADER, cycle_rows(thinned(cycles, MOST_CYCLES)))
    output.warn((*sample_caveats(log), *measured_caveats(log)))
    output.say(f"log: {log.path}{'' if cycling is None else _done_text(len(cycles), cycling.total)}")
    of_cycles = {} if cycling is None else {"cycles": [asdict(one) for one in cycles], "cycles_planned": cycling.total}
    caveats = tracking_caveats(log)
    output.result({**asdict(metrics), "caveats": caveats, "tripped": tripped, **of_cycles, **published})


def _done_text(done: int, planned: int) -> str:
    return f"   {done} of {planned} {'cycle is' if planned == 1 else 'cycles are'} done"
