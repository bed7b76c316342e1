"""`smadrive watch`: live values of a rig, without heat."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import inf, isfinite
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.options import RigFile, TraceFolder
from smadrive.cli.output import Output
from smadrive.cli.stdout import is_unread
from smadrive.cli.views.announcement import announce
from smadrive.cli.views.keyboard import end_interrupt, end_key
from smadrive.cli.views.watch_view import Extremes, watched_values
from smadrive.clock import VirtualClock
from smadrive.control.loop import Tick
from smadrive.display.card import count_text
from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.kinds import LOG
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Record, Rig
from smadrive.rig.switching_off.guardians import notes_waiting_guardians
from smadrive.runs.experiments import observe
from smadrive.runs.run_log import record_observation


def main(
    rig: RigFile,
    duration_s: Annotated[float | None, typer.Option("--for", help="End after this time, in s.")] = None,
    log_file: Annotated[
        Path | None, typer.Option("--log-file", "-o", help="Log (.h5) to write; none by default.")
    ] = None,
    trace: TraceFolder = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print one JSON object per measurement and line, and nothing else."),
    ] = False,
) -> None:
    """Show the live values of RIG, without heat: the heater is never armed. The key q or Ctrl-C ends the command.

    Both are its normal end, with exit code 0.

    On a terminal the values and a plot of the last minute are live; a pipe or a file gets a line a second.
    """
    output = Output(as_json)
    length_s = _checked_length(duration_s)
    if log_file is not None:
        check_output(log_file, LOG)
    config, extremes = load_rig(rig), Extremes()
    try:
        with notes_waiting_guardians(), Rig(config, trace_folder=trace) as open_rig:
            _check_end(open_rig, length_s)
            _print_latched(open_rig, output)
            with _shown(open_rig, length_s, log_file, extremes, output) as record, _end() as is_ended:
                observe(open_rig, length_s, record, is_ended)
    finally:
        if extremes.count:
            output.table(("quantity", "last", "lowest", "highest"), extremes.rows())
            output.say(count_text(extremes.count, "measurement") + ("" if log_file is None else f"   log: {log_file}"))


@contextmanager
def _end() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns True after q or Ctrl-C was pressed, or when the reader of the output is gone."""
    with end_key() as is_pressed, end_interrupt() as is_interrupted:
        yield lambda: is_pressed() or is_interrupted() or is_unread()


@contextmanager
def _shown(rig: Rig, length_s: float, log_file: Path | None, extremes: Extremes, output: Output) -> Iterator[Record]:
    """Yield the function that shows, and may record, each measurement."""
    with ExitStack() as stack:
        takers: list[Callable[[Tick], None]] = [extremes.add]
        if log_file is not None:
            takers.append(stack.enter_context(record_observation(log_file, rig, length_s)).tick)
            announce(output, log_file, "the observation", length_s, rig.clock)
        takers.append(stack.enter_context(watched_values(rig.config.name, output)))

        def record(tick: Tick) -> None:
            for take in takers:
                take(tick)

        yield record


def _checked_length(duration_s: float | None) -> float:
    """Return the length of the observation, infinite without `--for`. ConfigError when it is not above 0."""
    if duration_s is None:
        return inf
    if not 0.0 < duration_s < inf:
        cure = "give a time above 0 s, or leave the option out and end with q"
        raise ConfigError(
            "this is not a possible duration", where="--for", value=f"{duration_s:g} s", limit="above 0 s", cure=cure
        )
    return duration_s


def _check_end(rig: Rig, length_s: float) -> None:
    if isinstance(rig.clock, VirtualClock) and not isfinite(length_s):
        what, where = "the time of sim:// is virtual, so the command needs an end", f"rig '{rig.config.name}'"
        raise ConfigError(what, where=where, cure="give --for S, or serve the simulated device with `firmware-sim`")


def _print_latched(rig: Rig, output: Output) -> None:
    tripped = rig.latch.read()
    if tripped is not None:
        output.say(f"latched: {tripped}")
