"""The plots of displacement, temperature and current over time, with their data.

All traces share one data source, so that a new row is sent to the browser only once.
"""

from __future__ import annotations

from bokeh.models import ColumnDataSource, DataRange1d, Range, Range1d
from bokeh.plotting import figure

from smadrive.display.colours import PAGE_ESTIMATED, PAGE_MEASURED, PAGE_SETPOINT
from smadrive.stream.samples import COLUMN, Rows
from smadrive.tuning.page.view.figures import limit, lines, plain_figure

POINTS = 2000
"""Largest number of points of a trace."""
WINDOW_S = 60.0
SHORTEST_S = 1.0
"""The shortest window of time. At the start of a session, the window grows from it to `WINDOW_S`."""
DRAWN = (
    "time_s",
    "temperature_c",
    "displacement_mm",
    "current_a",
    "setpoint_c",
    "setpoint_mm",
    "estimated_c",
    "estimated_mm",
    "commanded_a",
)
"""The columns that are drawn over time."""


def following_axis(shortest: float) -> Range:
    """Return an axis that follows the values; it is never shorter than `shortest`, so that noise does not fill it."""
    return DataRange1d(min_interval=shortest)


class TimePlots:
    """The figures over time. The template page.html places them by their names.

    `displacement_axis` and `temperature_axis` are the vertical axes of their figures.
    """

    def __init__(
        self, current_max_a: float, temperature_max_c: float, displacement_axis: Range, temperature_axis: Range
    ) -> None:
        self.time = ColumnDataSource({name: [] for name in self.drawn})
        self._x = Range1d(0.0, WINDOW_S)
        self.followed = 0.0, WINDOW_S
        self.figures = [
            self._displacement(displacement_axis),
            self._temperature(temperature_axis, temperature_max_c),
            self._current(current_max_a),
        ]

    @property
    def drawn(self) -> tuple[str, ...]:
        """The names of the columns of the data source."""
        return DRAWN

    def add(self, rows: Rows) -> None:
        """Append new rows, and show the newest minute."""
        self.time.stream(self._columns(rows), rollover=POINTS)
        self._follow(float(rows[-1, COLUMN["time_s"]]))

    def show_rows(self, rows: Rows, window: tuple[float, float] | None) -> None:
        """Draw only these rows. `window` is the beginning and the end to show, in s; None shows the newest minute."""
        self.time.data = self._columns(rows)
        if window is not None:
            self._x.update(start=window[0], end=window[1])
        elif rows.size:
            self._follow(float(rows[-1, COLUMN["time_s"]]))

    @property
    def window(self) -> tuple[float, float]:
        """The beginning and the end of the shown time, in s. The user may have changed them in the browser."""
        return self._x.start, self._x.end

    def _follow(self, now_s: float) -> None:
        start_s = max(now_s - WINDOW_S, 0.0)
        self.followed = start_s, max(now_s, start_s + SHORTEST_S)
        self._x.update(start=self.followed[0], end=self.followed[1])

    def _columns(self, rows: Rows) -> dict[str, Rows]:
        """Return the columns of the data source for these rows."""
        return {name: rows[:, COLUMN[name]] for name in DRAWN}

    def _over_time(self, name: str, label: str, y_range: Range) -> figure:
        plot = plain_figure(name, label, "xpan,xwheel_zoom", x_range=self._x, y_range=y_range)
        plot.xaxis.formatter.use_scientific = False
        plot.xaxis.visible = False  # the lowest plot shows the time axis
        return plot

    def _displacement(self, axis: Range) -> figure:
        plot = self._over_time("displacement", "displacement / mm", axis)
        lines(plot, self.time, estimated_mm=PAGE_ESTIMATED, displacement_mm=PAGE_MEASURED, setpoint_mm=PAGE_SETPOINT)
        return plot

    def _temperature(self, axis: Range, temperature_max_c: float) -> figure:
        plot = self._over_time("temperature", "temperature / °C", axis)
        lines(plot, self.time, estimated_c=PAGE_ESTIMATED, temperature_c=PAGE_MEASURED, setpoint_c=PAGE_SETPOINT)
        limit(plot, temperature_max_c)
        return plot

    def _current(self, current_max_a: float) -> figure:
        plot = self._over_time("current", "current / A", Range1d(-0.03 * current_max_a, 1.1 * current_max_a))
        lines(plot, self.time, current_a=PAGE_MEASURED, commanded_a=PAGE_SETPOINT)
        limit(plot, current_max_a)
        return plot


def show_time_axis(plot: figure) -> None:
    """Show the time axis on the lowest plot of a column."""
    plot.xaxis.visible = True
    plot.xaxis.axis_label = "time / s"
