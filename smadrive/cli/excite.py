"""`smadrive excite`: the identification experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.options import RigFile, TraceFolder
from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.run_view import watched
from smadrive.control.loop import LoopMetrics
from smadrive.errors import TripError
from smadrive.files.atomic import LOG, check_output
from smadrive.identification.excitation import check_may_excite
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import record_excitation
from smadrive.runs.run_metrics import tripped_loop


def main(
    rig: RigFile,
    log_file: Annotated[Path, typer.Option("--log-file", "-o", help="Log (.h5) to write.")],
    trace: TraceFolder = None,
    as_json: AsJson = False,
) -> None:
    """Drive the wire of RIG through the temperature path of its rig file, within its limits, and record it."""
    output = Output(as_json)
    check_output(log_file, LOG)
    try:
        with Rig(load_rig(rig), trace_folder=trace) as bench:
            figures = _recorded(log_file, bench, quiet=output.quiet)
    except TripError as trip:
        try:
            _tell(log_file, tripped_loop(read_log(log_file)), output, tripped=str(trip))
        finally:
            raise trip  # whatever becomes of what is told, this is how it ended
    _tell(log_file, figures, output, tripped=None)


def _recorded(log_file: Path, bench: Rig, *, quiet: bool) -> LoopMetrics:
    """Excite the wire, logged to `log_file`, shown unless `quiet`. TripError."""
    found = bench.measure()
    limit_a = bench.config.limits.current_max_a
    excitation = bench.excitation(found.temperature_c)
    check_may_excite(excitation, bench.nominal_balance, limit_a, found)
    with (
        record_excitation(log_file, bench, excitation) as recorder,
        watched(recorder, "exciting", excitation.duration_s, limit_a, quiet=quiet) as record,
    ):
        return bench.excite(excitation, record)


def _tell(log_file: Path, figures: LoopMetrics, output: Output, *, tripped: str | None) -> None:
    missed = "1 missed deadline" if figures.missed_deadlines == 1 else f"{figures.missed_deadlines} missed deadlines"
    ended = "the heater is off" if tripped is None else "then it tripped"
    output.say(f"{log_file}: {figures.ticks} samples, {missed}; {ended}")
    output.result(
        {
            "ticks": figures.ticks,
            "missed_deadlines": figures.missed_deadlines,
            "trips": figures.trips,
            "log_file": str(log_file),
            "tripped": tripped,
        }
    )
