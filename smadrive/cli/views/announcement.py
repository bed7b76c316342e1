"""What a command prints around a run: its length and its log before it, its metrics after it, also after a trip."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from math import isfinite
from pathlib import Path

from smadrive.cli.terminal.output import Output
from smadrive.clock import Clock, VirtualClock
from smadrive.control.loop import TickHandler
from smadrive.display.number_text import count_text
from smadrive.errors import StoppedError, TripError
from smadrive.identification.excitation import Excitation
from smadrive.runs.experiments import Watch
from smadrive.runs.run_log import TickRecorder


def announce(output: Output, log_file: Path, what: str, duration_s: float, clock: Clock) -> None:
    """Print how long `what` takes and which log it writes."""
    lasts = (
        f"takes {duration_text(duration_s)}{_of_virtual_time(clock)}"
        if isfinite(duration_s)
        else "continues until q or Ctrl-C"
    )
    output.say(f"{log_file}: {what} {lasts}")


def announced(
    output: Output, log_file: Path, what: str, clock: Clock, watch: Watch, excitation: Excitation | None = None
) -> Watch:
    """Return a Watch that prints the announcement of `what`, and of `excitation` if given, and then calls `watch`."""

    def both(recorder: TickRecorder, duration_s: float) -> AbstractContextManager[TickHandler]:
        announce(output, log_file, what, duration_s, clock)
        if excitation is not None:
            announce_excitation(output, excitation, clock)
        return watch(recorder, duration_s)

    return both


def announce_excitation(output: Output, excitation: Excitation, clock: Clock) -> None:
    """Print plan, number of reversal curves and duration of an identification experiment."""
    curves = count_text(excitation.reversal_curves, "reversal curve")
    lasts = f"{excitation.duration_s:.0f} s{_of_virtual_time(clock)}"
    output.say(f"excitation: plan {excitation.plan}, {curves}, {lasts}")


def _of_virtual_time(clock: Clock) -> str:
    return " of virtual time" if isinstance(clock, VirtualClock) else ""


@contextmanager
def log_named_at_interruption(log_file: Path, what: str, rest: str = "") -> Iterator[None]:
    """If the `with` block is interrupted, add a note to the interruption: the name of the log, and then `rest`."""
    try:
        yield
    except (SystemExit, KeyboardInterrupt, StoppedError) as interruption:
        if log_file.exists():
            interruption.add_note(f"{log_file} holds {what} up to here{rest}")
        raise


@contextmanager
def metrics_after_trip(print_metrics: Callable[[str], None]) -> Iterator[None]:
    """If the `with` block trips, call `print_metrics` with the text of the trip. Raise the trip, even if that fails."""
    try:
        yield
    except TripError as trip:
        try:
            print_metrics(str(trip))
        finally:
            raise trip  # also when the output cannot be written


def duration_text(duration_s: float) -> str:
    """Return a duration as text with the digits that matter, such as `45 s`, `4 min 3 s` or `2 h 5 min`."""
    seconds = round(duration_s)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    minutes = round(duration_s / 60)
    return f"{minutes // 60} h {minutes % 60} min"
