"""`smadrive watch`: live values of a rig, without heat."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from smadrive.cli.live.publishing import Publish, each, run_publication
from smadrive.cli.parsing.options import PAGE_PORT, RigFile, TraceFolder
from smadrive.cli.terminal.output import Output
from smadrive.cli.terminal.stdout import is_unread
from smadrive.cli.views.announcement import announce
from smadrive.cli.views.keyboard import end_interrupt, end_key
from smadrive.cli.views.watch_view import Extremes, watched_values
from smadrive.clock import VirtualClock
from smadrive.control.loop import TickHandler
from smadrive.display.number_text import count_text
from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.extras import check_extra
from smadrive.files.kinds import LOG
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.rig.switching_off.guardians import notes_waiting_guardians
from smadrive.runs.experiments import observe
from smadrive.runs.run_log import record_observation

if TYPE_CHECKING:
    from smadrive.tuning.watching import WatchFeed


def main(
    rig: RigFile,
    duration_s: Annotated[float | None, typer.Option("--for", help="End after this time, in s.")] = None,
    log_file: Annotated[
        Path | None, typer.Option("--log-file", "-o", help="Log (.h5) to write; none by default.")
    ] = None,
    trace: TraceFolder = None,
    publish: Publish = None,
    page: Annotated[bool, typer.Option("--page", help="Show the values on a page in the browser, too.")] = False,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help=f"Port of the page on 127.0.0.1, {PAGE_PORT} by default; 0 picks a free one."
        ),
    ] = None,
    browser: Annotated[bool | None, typer.Option(help="Open the page in the browser; the default.")] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print one JSON object per measurement, each on its own line, and nothing else."),
    ] = False,
) -> None:
    """Show the live values of RIG, without heat: the heater is never armed.

    The key q and Ctrl-C end the command normally, with exit code 0.

    On a terminal the values and a plot of the last minute are live; a pipe or a file gets one line per second. The page
    has no controls: it shows plots of the whole time, and several people can open it.
    """
    output = Output(as_json)
    options = _page_options(port, browser, output) if page else None
    if not page:
        _check_no_page_option(port, browser)
    length_s = _checked_length(duration_s)
    if log_file is not None:
        check_output(log_file, LOG)
    config = load_rig(rig)
    with (
        notes_waiting_guardians(),
        run_publication(publish, config, "watch", output) as publication,
        ExitStack() as rig_use,
    ):
        open_rig = rig_use.enter_context(Rig(config, trace_folder=trace))
        publication.begin(open_rig)
        _check_end(open_rig, length_s)
        _print_latched(open_rig, output)
        with ExitStack() as stack:
            takers: list[TickHandler] = [stack.enter_context(_summary(open_rig, log_file, output)), *publication.takers]
            if log_file is not None:
                takers.append(stack.enter_context(record_observation(log_file, open_rig, length_s)).tick)
                announce(output, log_file, "the observation", length_s, open_rig.clock)
            ends = [stack.enter_context(end_key()), stack.enter_context(end_interrupt()), is_unread]
            before_end = ExitStack()
            if options is not None:
                feed = stack.enter_context(_page(open_rig, options, output))
                takers.append(feed.tick)
                ends.append(feed.off_requested)
                before_end.callback(feed.end)
            takers.append(stack.enter_context(watched_values(config, output)))
            with rig_use, before_end:  # frees the ports first: `smadrive off` waits for them
                observe(open_rig, length_s, each(takers), lambda: any(is_ended() for is_ended in ends))


@contextmanager
def _summary(rig: Rig, log_file: Path | None, output: Output) -> Iterator[TickHandler]:
    """Yield the function that takes each measurement. At the end print the extremes, and the counters of each bus."""
    extremes = Extremes()
    try:
        yield extremes.add
    finally:
        if extremes.count:
            output.table(("quantity", "last", "lowest", "highest"), extremes.rows())
            for name, counters in rig.bus_counters.items():
                output.say(f"bus of {name}: {counters}")
            output.say(count_text(extremes.count, "measurement") + ("" if log_file is None else f"   log: {log_file}"))


class _PageOptions(NamedTuple):
    port: int
    browser: bool


def _page_options(port: int | None, browser: bool | None, output: Output) -> _PageOptions:
    if output.quiet:
        raise ConfigError("is for a person, and --json for a program", where="--page", cure="leave one of them out")
    return _PageOptions(PAGE_PORT if port is None else port, browser is not False)


def _check_no_page_option(port: int | None, browser: bool | None) -> None:
    """Raise ConfigError if --port or --browser is given without --page."""
    for option, value in (("--port", port), ("--browser", browser)):
        if value is not None:
            raise ConfigError("is an option of the page", where=option, cure="add --page")


def _page(rig: Rig, options: _PageOptions, output: Output) -> AbstractContextManager[WatchFeed]:
    check_extra("tune", "--page")
    from smadrive.cli.live.page import watched_on_page  # noqa: PLC0415 (most calls open no page)

    return watched_on_page(rig, options.port, output, browser=options.browser)


def _checked_length(duration_s: float | None) -> float:
    """Return the length of the observation in s, infinite without `--for`. ConfigError for 0, less, or infinity."""
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
