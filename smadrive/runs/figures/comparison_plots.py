"""The plots of runs side by side: each run has one colour in every plot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from smadrive.display.colours import LIMIT, RUN_COLOURS, SETPOINT, SHADE
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.columns import COLUMNS
from smadrive.runs.comparison.comparison import RunComparison
from smadrive.runs.comparison.settings import CHECKSUM
from smadrive.runs.figures.log_plots import NOT_SCORED, PLANE_POINTS
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.tracking_error import error_percent, has_setpoint, measured_mm, scored_from_s
from smadrive.runs.plot_style import legend, line, panels
from smadrive.runs.report import Plot
from smadrive.runs.run_metadata import rig_config_of


def comparison_plots(comparison: RunComparison) -> Iterator[Plot]:
    """Yield the plots. A plot without data is left out; a plot leaves out a run without data."""
    displaced = [log for log in comparison.logs if _has(log, "displacement_mm")]
    if displaced:
        yield _displacement(comparison)
    yield _heat(comparison)
    if displaced:
        yield _plane(comparison)


def _displacement(comparison: RunComparison) -> Plot:
    scored = [log for log in comparison.logs if has_setpoint(log) and np.isfinite(error_percent(log)).any()]
    figure, (upper, *lower) = panels((3.0, 1.9) if scored else (3.0,))
    is_one = CHECKSUM not in comparison.settings and all("reference" in log.metadata for log in comparison.logs)
    _draw(comparison, upper, "displacement_mm")
    for number, (log, colour) in enumerate(zip(comparison.logs, RUN_COLOURS, strict=False)):
        if has_setpoint(log) and (number == 0 or not is_one):
            look = {"color": SETPOINT, "label": "setpoint"} if is_one else {"color": colour}
            line(upper, log.column("time_s"), log.column_with_gaps("setpoint_mm"), ls="--", lw=0.9, **look)
    legend(upper)
    for ax in lower:
        for log, colour in zip(comparison.logs, RUN_COLOURS, strict=False):
            if log in scored:
                line(ax, log.column("time_s"), error_percent(log), color=colour, lw=0.9)
        ax.axhline(0.0, color=SETPOINT, lw=0.6)
        ax.axvspan(0.0, max(map(scored_from_s, scored)), color=SHADE, lw=0)
        ax.set_ylabel("error / % of stroke")
    figure.axes[-1].set_xlabel(COLUMNS["time_s"].axis_label)
    setpoint = "Dashed: the setpoint" if is_one else "Dashed: the setpoint of each run, in its colour"
    caption = f"{setpoint}. Error = setpoint − displacement. {NOT_SCORED}" if scored else "Measured displacement."
    return Plot("Displacement", figure, caption)


def _heat(comparison: RunComparison) -> Plot:
    figure, (upper, lower) = panels((2.6, 1.9))
    _draw(comparison, upper, "temperature_c")
    legend(upper)
    _draw(comparison, lower, "current_a")
    for number, log in enumerate(comparison.logs):
        limits, dashes = rig_config_of(log).limits, (0, (1, 2 + number))
        upper.axhline(limits.temperature_max_c, color=LIMIT, ls=dashes, lw=1.0)
        lower.axhline(limits.current_max_a, color=LIMIT, ls=dashes, lw=1.0)
    lower.set_xlabel(COLUMNS["time_s"].axis_label)
    return Plot("Heat", figure, "Measured temperature and current. Dotted: the limits of the rigs.")


def _plane(comparison: RunComparison) -> Plot:
    figure, (ax,) = panels((4.6,))
    for name, log, colour in zip(comparison.names, comparison.logs, RUN_COLOURS, strict=False):
        every = max(1, log.column("time_s").size // PLANE_POINTS)
        column = "estimated_c" if _has(log, "estimated_c") else "temperature_c"
        path = log.column_with_gaps(column)[::every], measured_mm(log)[::every]
        if _has(log, "displacement_mm"):
            ax.plot(*path, color=colour, lw=0.8, alpha=0.8, label=name, rasterized=True)
    legend(ax)
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    caption = "Measured displacement over the estimated wire temperature, or over the measured one without an estimate."
    return Plot("Temperature and displacement", figure, caption)


def _draw(comparison: RunComparison, ax: Axes, name: str) -> None:
    """Draw the column `name` of each run over time, in the colour of the run."""
    for title, log, colour in zip(comparison.names, comparison.logs, RUN_COLOURS, strict=False):
        if _has(log, name):
            line(ax, log.column("time_s"), _values(log, name), color=colour, lw=1.2, label=title)
    ax.set_ylabel(COLUMNS[name].axis_label)


def _has(log: Log, name: str) -> bool:
    return bool(np.isfinite(_values(log, name)).any())


def _values(log: Log, name: str) -> FloatArray:
    """Return the column; readings of a displacement sensor that was replaced are left out."""
    return measured_mm(log) if name == "displacement_mm" else log.column_with_gaps(name)
