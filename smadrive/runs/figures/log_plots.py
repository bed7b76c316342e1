"""The plots of one log: setpoint and displacement, temperature and current, hysteresis loop, loop timing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from smadrive.display.colours import AT_LIMIT, COOLING, ESTIMATED, FAINT, HEATING, LIMIT, MEASURED, SETPOINT, SHADE
from smadrive.hysteresis import HysteresisModel
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.columns import COLUMNS
from smadrive.runs.figures.session_plots import session_plot
from smadrive.runs.log.reader import Log
from smadrive.runs.metrics.caveats import sample_caveats
from smadrive.runs.metrics.run import is_virtual
from smadrive.runs.metrics.tracking_error import error_percent, has_setpoint, measured_mm, scored_from_s
from smadrive.runs.plot_style import legend, line, panels
from smadrive.runs.report import Plot
from smadrive.runs.run_kind import RunKind
from smadrive.runs.run_metadata import rig_config_of, wire_of

NOT_SCORED = "The approach (grey) brings the wire to the reference and is not scored."
REPLACED = "The error is unknown while the sensor was replaced."

PLANE_POINTS = 6000
"""The plot of displacement over temperature shows every n-th row of the log: n = max(1, rows // PLANE_POINTS)."""


def log_plots(log: Log) -> Iterator[Plot]:
    """Yield the plots of the log. Plots without data are left out."""
    if has_setpoint(log):
        yield _tracking(log)
    elif log.kind is not RunKind.SESSION and np.isfinite(log.column_with_gaps("displacement_mm")).any():
        yield _displacement(log)
    if log.kind is RunKind.SESSION:
        yield session_plot(log)
    yield _heat(log)
    if np.isfinite(measured_mm(log)).any():
        yield _plane(log)
    yield _timing(log)


def _tracking(log: Log) -> Plot:
    is_scored = np.isfinite(error_percent(log)).any()
    figure, (upper, *lower) = panels((3.0, 1.7) if is_scored else (3.0,))
    replaced_mm = np.where(np.isfinite(measured_mm(log)), np.nan, log.column_with_gaps("displacement_mm"))
    is_replaced = bool(np.isfinite(replaced_mm).any())
    if is_replaced:
        line(upper, log.column("time_s"), replaced_mm, color=FAINT, lw=1.8, label="sensor (not used)")
    line(upper, log.column("time_s"), measured_mm(log), color=MEASURED, lw=1.8, label=COLUMNS["displacement_mm"].role)
    _draw(upper, log, "estimated_mm", color=ESTIMATED, lw=0.9)
    _draw(upper, log, "setpoint_mm", color=SETPOINT, ls="--", lw=1.0)
    legend(upper)
    for ax in lower:
        draw_error(ax, log, MEASURED)
    figure.axes[-1].set_xlabel(COLUMNS["time_s"].axis_label)
    error = f"Error = setpoint − displacement. {NOT_SCORED if 'reference' in log.metadata else ''}".strip()
    caption = error if is_scored else f"No error is shown: {sample_caveats(log)[-1]}."
    return Plot("Tracking", figure, f"{caption} {REPLACED}" if is_replaced else caption)


def _displacement(log: Log) -> Plot:
    """Return the displacement over time of a run that has no reference, such as an excitation."""
    figure, (ax,) = panels((2.4,))
    _draw(ax, log, "estimated_mm", color=ESTIMATED, lw=1.8)
    _draw(ax, log, "displacement_mm", color=MEASURED, lw=1.2)
    ax.set_xlabel(COLUMNS["time_s"].axis_label)
    return Plot("Displacement", figure, "Displacement over time. There is no reference, and no tracking error.")


def _draw(ax: Axes, log: Log, name: str, **look: Any) -> None:
    """Draw a column over time. The role of the column labels the line, its quantity and unit label the axis."""
    facts = COLUMNS[name]
    line(ax, log.column("time_s"), log.column_with_gaps(name), label=facts.role, **look)
    ax.set_ylabel(facts.axis_label)


def draw_error(ax: Axes, log: Log, colour: str) -> None:
    """Draw the tracking error. The approach, which is not scored, is shaded."""
    line(ax, log.column("time_s"), error_percent(log), color=colour, lw=0.9)
    ax.axhline(0.0, color=SETPOINT, lw=0.6)
    ax.axvspan(0.0, scored_from_s(log), color=SHADE, lw=0)
    ax.set_ylabel("error / % of stroke")


def _heat(log: Log) -> Plot:
    time_s, limits = log.column("time_s"), rig_config_of(log).limits
    figure, (upper, lower) = panels((2.6, 1.9))
    _draw(upper, log, "temperature_c", color=FAINT, lw=1.6)
    _draw(upper, log, "estimated_c", color=ESTIMATED, lw=1.1)
    _draw(upper, log, "setpoint_c", color=SETPOINT, ls="--", lw=0.8)
    upper.axhline(limits.temperature_max_c, color=LIMIT, ls=":", lw=1.2, label="trip limit")
    legend(upper)
    _shade(lower, time_s, log.column("limited") > 0)
    _draw(lower, log, "commanded_a", color=SETPOINT, lw=0.7)
    _draw(lower, log, "current_a", color=MEASURED, lw=1.0)
    lower.axhline(limits.current_max_a, color=LIMIT, ls=":", lw=1.2, label="limit")
    lower.set(xlabel=COLUMNS["time_s"].axis_label, ylim=(-0.03 * limits.current_max_a, 1.08 * limits.current_max_a))
    legend(lower)
    return Plot(
        "Heat",
        figure,
        "Temperature of the wire, as far as known, and the current; shaded: the output was at a limit.",
    )


def _plane(log: Log) -> Plot:
    figure, (ax,) = panels((4.6,))
    every = max(1, log.column("time_s").size // PLANE_POINTS)
    is_estimated = bool(np.isfinite(log.column_with_gaps("estimated_c")).any())
    temperature_c = log.column_with_gaps("estimated_c" if is_estimated else "temperature_c")[::every]
    dots = ax.scatter(
        temperature_c,
        measured_mm(log)[::every],
        c=log.column("time_s")[::every],
        s=4,
        cmap="viridis",
        linewidths=0,
        rasterized=True,
    )
    figure.colorbar(dots, ax=ax, label="time / s", pad=0.01, aspect=30).outline.set_visible(False)
    caption = (
        f"Points: measured displacement over the {'estimated' if is_estimated else 'measured'} temperature of the wire."
    )
    if "wire" in log.metadata:
        draw_branches(ax, wire_of(log).model)
        caption += " Lines: the major loop of the model; the minor loops lie inside it."
        legend(ax)
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    return Plot("Temperature and displacement", figure, caption)


def draw_branches(ax: Axes, model: HysteresisModel) -> None:
    """Draw the major loop, cut to the range in which its branches differ."""
    up = np.linspace(*model.input_range, 800)
    loop = model.simulate(np.concatenate((up, up[::-1])))
    heating, cooling = loop[:800], loop[800:][::-1]
    moving = np.abs(heating - cooling) > 2e-3 * abs(model.scale)
    shown = slice(max(int(np.argmax(moving)) - 60, 0), 800 - max(int(np.argmax(moving[::-1])) - 60, 0))
    ax.plot(up[shown], heating[shown], color=HEATING, lw=1.4, label="model, heating")
    ax.plot(up[shown], cooling[shown], color=COOLING, lw=1.4, label="model, cooling")


def _timing(log: Log) -> Plot:
    time_s, period_ms = log.column("time_s"), 1e3 / rig_config_of(log).rate_hz
    figure, (*upper, lower) = panels((1.5,) if is_virtual(log) else (1.5, 1.5))
    for ax in upper:
        line(ax, time_s, 1e3 * log.column("late_s"), color=MEASURED, lw=0.8)
        ax.set(ylabel="late / ms", ylim=(0.0, max(1.0, 1.1e3 * log.column("late_s").max())))
    line(lower, time_s[1:], 1e3 * np.diff(time_s), color=MEASURED, lw=0.8)
    lower.axhline(period_ms, color=SETPOINT, ls="--", lw=0.8)
    lower.set(
        ylabel="spacing / ms", xlabel="time / s", ylim=(0.0, 1.1e3 * np.diff(time_s).max(initial=0.001 * period_ms))
    )
    lateness = (
        "Virtual time waits for every tick, so no tick is late. Shown: the time between two measurements"
        if is_virtual(log)
        else "The delay of each tick after its deadline, and the time between two measurements"
    )
    return Plot(
        "Loop timing",
        figure,
        f"{lateness}, nominally {period_ms:g} ms; each lost exchange or skipped deadline adds a period.",
    )


def _shade(ax: Axes, time_s: FloatArray, where: NDArray[np.bool_]) -> None:
    """Shade the time ranges in which `where` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(np.int8)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        ax.axvspan(time_s[begin], time_s[min(end, time_s.size - 1)], color=AT_LIMIT, lw=0)
