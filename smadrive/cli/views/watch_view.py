"""The display of `watch`: live values and a plot of the last minute on a terminal, one line per second elsewhere."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf, isfinite

from rich.console import Console
from rich.text import Text

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.run_view import drawing, is_seen_live
from smadrive.control.loop import Tick, TickHandler
from smadrive.display.number_text import quantity
from smadrive.rig.config import RigConfig
from smadrive.rig.supervision import unexpected_current

WINDOW_S = 60.0
"""The time that a plot shows, s."""

LINE_S = 1.0
"""The time between two lines for a pipe or a file, s."""

LEVELS = "▁▂▃▄▅▆▇█"
PLOT_ROWS = 4
LABEL = 12
"""Width of the numbers beside a plot, in characters."""

QUANTITIES = (
    ("temperature", "temperature_c", 2, "°C", 1.0),
    ("displacement", "displacement_mm", 4, "mm", 0.1),
    ("current", "current_a", 4, "A", inf),
    ("voltage", "voltage_v", 3, "V", inf),
)
"""Name, attribute of a Measurement, decimal places, unit, smallest span of the value axis (inf: no plot)."""


class Extremes:
    """The last, the lowest and the highest value of each quantity, and the number of measurements."""

    def __init__(self) -> None:
        self.count = 0
        self._values: dict[str, tuple[float, float, float]] = {}

    def add(self, tick: Tick) -> None:
        """Count a measurement. An invalid value changes neither the lowest nor the highest value."""
        self.count += 1
        for name, attribute, *_ in QUANTITIES:
            value = getattr(tick.measurement, attribute)
            _, low, high = self._values.get(name, (value, inf, -inf))
            self._values[name] = (value, min(low, value), max(high, value)) if isfinite(value) else (value, low, high)

    def rows(self) -> list[tuple[str, ...]]:
        """Return one row of texts for each quantity: its name, its last, its lowest and its highest value."""
        return [
            (name, *(quantity(value, digits, unit) for value in self._values[name]))
            for name, _, digits, unit, _ in QUANTITIES
        ]


class WatchView:
    """The live display: values, faults, and a plot of the last minute for temperature and displacement."""

    def __init__(self, config: RigConfig, width: Callable[[], int]) -> None:
        self._config = config
        self._width = width
        self._latest: Tick | None = None
        self._history: deque[Tick] = deque()

    def tick(self, tick: Tick) -> None:
        """Show this measurement from now on."""
        self._history.append(tick)
        while self._history[0].time_s < tick.time_s - WINDOW_S:
            self._history.popleft()
        self._latest = tick

    def __rich__(self) -> Text:
        """Return the text of the display at this moment."""
        tick = self._latest
        if tick is None:
            return Text(f"{self._config.name}: starting")
        text = Text(overflow="fold")
        warning = unexpected_current(self._config, tick.measurement)
        text.append(self._config.name, "bold").append(f"  {tick.time_s:.1f} s, ")
        text.append(warning or "heater off", "bold red" if warning else "").append("; q or Ctrl-C ends the command")
        history = tuple(self._history)
        for name, attribute, digits, unit, span in QUANTITIES:
            text.append(f"\n{name:<13}", "dim").append(_value_text(tick, attribute, digits, unit))
            points = [(one.time_s, getattr(one.measurement, attribute)) for one in history]
            if isfinite(span) and any(isfinite(value) for _, value in points):
                for line in plot_lines(points, self._width() - LABEL - 2, span, digits):
                    text.append(f"\n{line}", "green")
        if tick.measurement.device_faults:
            text.append(f"\nfaults       {', '.join(tick.measurement.device_faults)}", "bold red")
        return text


def plot_lines(points: list[tuple[float, float]], width: int, span: float, digits: int) -> list[str]:
    """Return a plot of (time, value) over the last `WINDOW_S` as lines of text. The right edge is the present.

    The value axis spans at least `span`. Each column shows the latest finite value of its part of the time.
    """
    width = max(width, 1)
    columns: list[float | None] = [None] * width
    end_s = points[-1][0]
    for time_s, value in points:
        if isfinite(value):
            age = int((end_s - time_s) / WINDOW_S * width)
            columns[width - 1 - min(age, width - 1)] = value
    values = [value for value in columns if value is not None]
    middle, half = 0.5 * (min(values) + max(values)), max(0.5 * (max(values) - min(values)), 0.5 * span)
    low, steps = middle - half, PLOT_ROWS * len(LEVELS) - 1
    heights = [None if value is None else round((value - low) / (2.0 * half) * steps) for value in columns]
    lines = []
    for row in reversed(range(PLOT_ROWS)):
        level = {PLOT_ROWS - 1: f"{low + 2.0 * half:.{digits}f}", 0: f"{low:.{digits}f}"}.get(row, "")
        lines.append(f"{level:>{LABEL}} " + "".join(_block(height, row) for height in heights))
    return lines


def _block(height: int | None, row: int) -> str:
    """Return the character of one column in one row. The column is filled to `height`, in eighths of a row."""
    if height is None or height < row * len(LEVELS):
        return " "
    return LEVELS[min(height - row * len(LEVELS), len(LEVELS) - 1)]


def _value_text(tick: Tick, attribute: str, digits: int, unit: str) -> str:
    if attribute == "temperature_c" and tick.measurement.temperature_fault:
        return tick.measurement.temperature_fault
    return quantity(getattr(tick.measurement, attribute), digits, unit)


@contextmanager
def watched_values(config: RigConfig, output: Output) -> Iterator[TickHandler]:
    """Yield the function that shows each measurement: live, as one line per second, or as a JSON object."""
    console = Console(stderr=True)
    if output.quiet:
        yield lambda tick: output.json_line({**tick.measurement._asdict(), "time_s": tick.time_s})
    elif is_seen_live(console):
        view = WatchView(config, lambda: console.width)
        with drawing(view, console):
            yield view.tick
    else:
        yield _Lines(config, output).tick


class _Lines:
    """Prints a line of values every `LINE_S`."""

    def __init__(self, config: RigConfig, output: Output) -> None:
        self._config = config
        self._output = output
        self._printed_s = -inf

    def tick(self, tick: Tick) -> None:
        if tick.time_s - self._printed_s < LINE_S - 0.01:  # the times of measurements vary by milliseconds
            return
        self._printed_s = tick.time_s
        values = (_value_text(tick, attribute, digits, unit) for _, attribute, digits, unit, _ in QUANTITIES)
        warning = unexpected_current(self._config, tick.measurement)
        problems = (*tick.measurement.device_faults, *filter(None, [warning]))
        self._output.say(f"{tick.time_s:.1f} s: {', '.join((*values, *problems))}")
