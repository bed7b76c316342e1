"""The plots of the tuning page: TimePlots, the tracking error over time, hysteresis plane and firing strengths."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from bokeh.models import ColumnDataSource, Range1d, Span
from bokeh.plotting import figure

from smadrive.display.colours import PAGE_COOLING, PAGE_ESTIMATED, PAGE_HEATING, PAGE_MEASURED, PAGE_SETPOINT
from smadrive.hysteresis import IdentifiedModel, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.stream.samples import COLUMN, Rows
from smadrive.tuning.page.view.error_axis import error_axis
from smadrive.tuning.page.view.figures import lines, plain_figure
from smadrive.tuning.page.view.time_plots import DRAWN, POINTS, TimePlots, show_time_axis

MOVED = 0.004
"""The measured loop gets a new point when the wire has moved by this share of an axis."""

BRANCH_POINTS = 200
ERROR_TICKS = 4
"""Approximate number of ticks at the axis of the error. Its plot is low, and more numbers would overlap."""


class Plots(TimePlots):
    """All figures of the tuning page. The template page.html places them by their names."""

    def __init__(self, current_max_a: float, temperature_max_c: float) -> None:
        self._mm, self._plane_mm = Range1d(0.0, 1.0), Range1d(0.0, 1.0)
        super().__init__(current_max_a, temperature_max_c, self._mm, Range1d(15.0, 1.06 * temperature_max_c))
        self._branches = ColumnDataSource({"v": [], "heating": [], "cooling": []})
        self._loop = ColumnDataSource({"v": [], "y": []})
        self._state = ColumnDataSource({"v": [], "y": []})
        self._turning_points = ColumnDataSource({"v": [], "y": []})
        self._rules = ColumnDataSource({"set": [], "strength": [], "colour": []})
        self._plane_c = Range1d(15.0, 1.02 * temperature_max_c)
        self._drawn_to = np.full(2, np.nan)
        self._error_range = Range1d(-1.0, 1.0)
        self._model: IdentifiedModel | None = None
        self._travel_mm: tuple[float, float] | None = None
        self.figures += [self._error(), self._plane(), self._firing()]

    @property
    def drawn(self) -> tuple[str, ...]:
        """The names of the columns of the data source."""
        return (*DRAWN, "error_percent")

    def show_model(self, model: IdentifiedModel, travel_mm: tuple[float, float]) -> None:
        """Draw the branches of a new model, and fit the displacement axes to `travel_mm`, the ends of its travel."""
        self._model, self._travel_mm = model, travel_mm
        self._turning_points.data = {"v": [], "y": []}
        v = np.linspace(*model.input_range, BRANCH_POINTS)
        branches = [model.offset + model.scale * model.branch(v, rising=rising) for rising in (True, False)]
        self._branches.data = {"v": v, "heating": branches[0], "cooling": branches[1]}
        low_mm, high_mm = min(travel_mm), max(travel_mm)
        margin_mm = 0.06 * (high_mm - low_mm)
        for axis in (self._mm, self._plane_mm):
            axis.update(start=low_mm - margin_mm, end=high_mm + margin_mm)

    def add(self, rows: Rows) -> None:
        """Append new rows, and show the newest minute. `show_model` must have been called before."""
        super().add(rows)
        self._fit_error_axis()

    def show_rows(self, rows: Rows, window: tuple[float, float] | None) -> None:
        """Draw only these rows. `window` is the beginning and the end to show, in s; None shows the newest minute.

        `show_model` must have been called before.
        """
        super().show_rows(rows, window)
        self._fit_error_axis()

    @property
    def stroke_mm(self) -> float:
        """The length of the wire's travel in mm. `show_model` must have been called before."""
        assert self._travel_mm is not None
        return abs(self._travel_mm[1] - self._travel_mm[0])

    def _columns(self, rows: Rows) -> dict[str, Rows]:
        columns = super()._columns(rows)
        measured_mm = columns["displacement_mm"]
        reached_mm = np.where(np.isfinite(measured_mm), measured_mm, columns["estimated_mm"])
        columns["error_percent"] = 100.0 * (columns["setpoint_mm"] - reached_mm) / self.stroke_mm
        return columns

    def _fit_error_axis(self) -> None:
        """Fit the error axis to the errors in the window."""
        times_s, errors = (np.asarray(self.time.data[name]) for name in ("time_s", "error_percent"))
        from_s, to_s = self.window
        axis = self._error_range
        ends = error_axis(errors[(times_s >= from_s) & (times_s <= to_s)], (axis.start, axis.end))
        if ends != (axis.start, axis.end):
            axis.update(start=ends[0], end=ends[1])

    def show_state(self, rows: Rows) -> None:
        """Show the state of the wire on the hysteresis plane, and the firing strengths of the rules in this state.

        `rows` are the rows since the last call.
        """
        before, now = rows[0], rows[-1]
        wire_c, reached_mm = _wire_c(now), _first(now, "displacement_mm", "estimated_mm")
        if not (isfinite(wire_c) and isfinite(reached_mm)):
            return
        self._state.data = {"v": [wire_c], "y": [reached_mm]}
        self._draw_loop(rows[:, [COLUMN["estimated_c"], COLUMN["displacement_mm"]]])
        rules = self._model.local if isinstance(self._model, TSFuzzyPreisach) else self._model
        if isinstance(rules, TSFuzzyDuhem):
            centres = [f"{centre:.1f}" for centre in rules.sets.centres]
            if self._fired.x_range.factors != centres:
                self._fired.x_range.factors = centres
            colour = PAGE_HEATING if wire_c >= _wire_c(before) else PAGE_COOLING
            strengths = rules.sets.weights(np.array([wire_c]))[0]
            self._rules.data = {"set": centres, "strength": strengths, "colour": [colour] * len(centres)}

    def show_turning_points(self, temperatures_c: Sequence[float]) -> None:
        """Mark the turning points in the wire's memory. `temperatures_c` are their temperatures, the oldest first.

        `show_model` must have been called before.
        """
        assert self._model is not None
        if temperatures_c != self._turning_points.data["v"]:
            y = self._model.simulate(temperatures_c).tolist() if len(temperatures_c) else []
            self._turning_points.data = {"v": list(temperatures_c), "y": y}

    def _draw_loop(self, path: Rows) -> None:
        """Extend the drawn loop by `path` (rows, 2): temperature (°C) and displacement (mm). NaN is a gap."""
        reach = np.array([axis.end - axis.start for axis in (self._plane_c, self._plane_mm)])
        drawn = []
        for point in path:
            if _has_moved(self._drawn_to, point, MOVED * reach):
                self._drawn_to = point
                drawn.append(point)
        if drawn:
            v, y = np.array(drawn).T
            self._loop.stream({"v": v, "y": y}, POINTS)

    def _error(self) -> figure:
        plot = self._over_time("error", "error / %", self._error_range)
        plot.yaxis.ticker.desired_num_ticks = ERROR_TICKS
        lines(plot, self.time, error_percent=PAGE_HEATING)
        plot.add_layout(Span(location=0.0, dimension="width", line_color=PAGE_SETPOINT, line_width=1))
        show_time_axis(plot)
        return plot

    def _plane(self) -> figure:
        plot = plain_figure("plane", "displacement / mm", x_range=self._plane_c, y_range=self._plane_mm)
        plot.xaxis.axis_label = "temperature of the wire / °C"
        plot.line("v", "heating", source=self._branches, color=PAGE_HEATING, line_width=2, alpha=0.75)
        plot.line("v", "cooling", source=self._branches, color=PAGE_COOLING, line_width=2, alpha=0.75)
        plot.line("v", "y", source=self._loop, color=PAGE_MEASURED, line_width=1.3)
        plot.scatter(
            "v", "y", source=self._turning_points, marker="square", size=7, fill_alpha=0.0, color=PAGE_ESTIMATED
        )
        plot.scatter("v", "y", source=self._state, size=11, color=PAGE_ESTIMATED, line_color="white", line_width=1.5)
        return plot

    def _firing(self) -> figure:
        plot = plain_figure("firing", "firing strength", x_range=["–"], y_range=Range1d(0.0, 1.05))
        plot.xaxis.axis_label = "centre / °C"
        plot.xaxis.major_label_orientation = 0.8
        plot.vbar("set", top="strength", width=0.8, color="colour", source=self._rules)
        self._fired = plot
        return plot


def _has_moved(before: Rows, now: Rows, far: Rows) -> bool:
    """Return True if the point `now` must be drawn after the point `before`. A point is temperature and displacement.

    `far` holds the least difference of each coordinate. A known point is drawn if one of its coordinates differs by at
    least this difference. Of several unknown points (NaN) in a row, only the first is drawn: it ends the line.
    """
    if np.isnan(now).any():
        return not np.isnan(before).any()
    return not bool((np.abs(now - before) < far).all())


def _first(row: Rows, *names: str) -> float:
    return next((float(row[COLUMN[name]]) for name in names if isfinite(row[COLUMN[name]])), float("nan"))


def _wire_c(row: Rows) -> float:
    return _first(row, "estimated_c", "temperature_c")
