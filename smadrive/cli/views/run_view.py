"""The display of a run on a terminal: progress, live values, latest events.

The loop assigns its latest tick to the display; a thread draws the display a few times a second. A blocked terminal
(Ctrl-S, a slow line) stops that thread, not the loop. The display is plain text: Python runs one thread at a time, so
the layout of a table would make ticks late.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import isfinite

from rich.console import Console, RichCast
from rich.live import Live
from rich.text import Text

from smadrive.control.loop import Tick, TickHandler
from smadrive.display.number_text import quantity
from smadrive.runs.experiments import Watch
from smadrive.runs.run_log import TickRecorder

DRAWN_PER_S = 5
BAR = 40
"""Greatest length of the progress bar, in characters."""
NAME, VALUE, GAP = 13, 11, 2
"""Widths of a name, of its value, and of the gap to the next name, in characters."""
WIDE = 120
"""Width of a terminal that shows every row in one line, in characters."""

GIVE_WAY_S = 0.0005
"""If the loop waits for Python's interpreter lock, the drawing thread gives it up after this time (default 5 ms)."""


class RunView:
    """The display of a run of `duration_s` with the limit `current_max_a`. `latest` is the tick on display.

    `width` returns the present width of the terminal. A narrow terminal shows fewer values in a row, and a shorter bar.
    """

    def __init__(
        self,
        title: str,
        duration_s: float,
        current_max_a: float,
        recorder: TickRecorder,
        width: Callable[[], int] = lambda: WIDE,
    ) -> None:
        self._width = width
        self._title = title
        self._duration_s = duration_s
        self._current_max_a = current_max_a
        self._recorder = recorder
        self.latest: Tick | None = None

    def __rich__(self) -> Text:
        """Return the text of the display at this moment."""
        tick = self.latest
        if tick is None:
            return Text(f"{self._title}: starting")
        text, width = Text(overflow="fold"), self._width()
        self._add_progress(text, tick.time_s, width)
        self._add_values(text, tick, width)
        if tick.measurement.device_faults:
            text.append(f"\n{'faults':<{NAME}} {', '.join(tick.measurement.device_faults)}", "bold red")
        for event in tuple(self._recorder.latest):
            text.append(f"\n{event.time_s:.2f} s: {event.message}", "yellow")
        return text

    def _add_progress(self, text: Text, time_s: float, width: int) -> None:
        text.append(f"{self._title}  ", "bold")
        if isfinite(self._duration_s):
            time_s = min(time_s, self._duration_s)  # the last tick may come after the end
            times = f"{time_s:.1f} of {self._duration_s:.1f} s"
            bar = max(min(BAR, width - len(text) - len(times) - 2), 0)
            done = round(bar * time_s / self._duration_s)
            text.append("━" * done, "green").append("━" * (bar - done), "dim").append("  " if bar else "")
            text.append(times)
        else:
            text.append(f"{time_s:.1f} s")

    def _add_values(self, text: Text, tick: Tick, width: int) -> None:
        measured, command = tick.measurement, tick.command
        limits = ", ".join(measured.limits)
        is_estimated = isfinite(tick.reached_mm) and not isfinite(tick.measured_mm)
        displacement = "estimated" if is_estimated else "displacement"
        temperature = measured.temperature_fault or quantity(measured.temperature_c, 1, "°C")
        values = (
            ("setpoint", quantity(command.setpoint_mm, 3, "mm")),
            (displacement, quantity(tick.reached_mm, 3, "mm")),
            ("error", quantity(command.setpoint_mm - tick.reached_mm, 3, "mm")),
            ("wire setpoint", quantity(command.setpoint_c, 1, "°C")),
            ("temperature", temperature),
            ("late", f"{1e3 * tick.late_s:.1f} ms"),
            ("current", quantity(measured.current_a, 3, "A")),
            ("limit", quantity(self._current_max_a, 3, "A")),
            ("limited by", limits or "nothing"),
        )
        in_a_row = min(max((width + GAP) // (NAME + 1 + VALUE + GAP), 1), 3)
        for n, (name, value) in enumerate(values):
            text.append(" " * GAP if n % in_a_row else "\n")
            text.append(f"{name:<{NAME}} ", "dim").append(f"{value:>{VALUE}}")


@contextmanager
def watched(
    recorder: TickRecorder, title: str, duration_s: float, current_max_a: float, *, quiet: bool
) -> Iterator[TickHandler]:
    """Yield the function that the loop calls with each tick: it records the tick, and shows it unless `quiet`."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield recorder.tick
        return
    view = RunView(title, duration_s, current_max_a, recorder, lambda: console.width)

    def record(tick: Tick) -> None:
        recorder.tick(tick)
        view.latest = tick

    with drawing(view, console):
        yield record


def shown(title: str, current_max_a: float, *, quiet: bool) -> Watch:
    """Return a Watch that shows an experiment on the terminal (see `watched`)."""
    return lambda recorder, duration_s: watched(recorder, title, duration_s, current_max_a, quiet=quiet)


def is_seen_live(console: Console) -> bool:
    """Return True if a person sees a live display: standard error, where `console` draws, and stdout are terminals.

    If stdout is a pipe or a file, its reader gets lines instead.
    """
    return console.is_terminal and sys.stdout.isatty()


@contextmanager
def drawing(view: RichCast, console: Console) -> Iterator[None]:
    """Draw `view` in a thread during the `with` block. A lost terminal ends only the drawing."""
    before_s = sys.getswitchinterval()
    live = Live(view, console=console, refresh_per_second=DRAWN_PER_S, transient=True)
    with suppress(OSError):
        live.start(refresh=True)
    sys.setswitchinterval(GIVE_WAY_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)
        with suppress(OSError):
            live.stop()
