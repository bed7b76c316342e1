"""The plots of one log: what was wanted, what the wire did, what it took, and whether the loop kept its time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from smadrive.hysteresis import HysteresisModel
from smadrive.runs.log.reader import Log
from smadrive.runs.plots import (
    COOLING,
    ESTIMATED,
    FAINT,
    HEATING,
    LIMIT,
    MEASURED,
    WANTED,
    legend,
    line,
    panels,
)
from smadrive.runs.report import Plot
from smadrive.runs.run_metadata import logged_reference, logged_rig, logged_wire
from smadrive.runs.run_metrics import error_percent, is_virtual, tracking_caveats

Array = NDArray[np.float64]

NOT_SCORED = "The approach (grey) brings the wire to the reference and is not scored."

PLANE_POINTS = 6000
"""The plane is drawn with at most this many of the recorded points."""


def log_plots(log: Log) -> Iterator[Plot]:
    """Every plot that the log has something for."""
    if "reference" in log.about:
        yield _tracking(log)
    yield _heat(log)
    if np.isfinite(log.signal("displacement_mm")).any():
        yield _plane(log)
    yield _timing(log)


def _tracking(log: Log) -> Plot:
    time_s = log.column("time_s")
    is_scored = np.isfinite(error_percent(log)).any()
    figure, (upper, *lower) = panels((3.0, 1.7) if is_scored else (3.0,))
    line(upper, time_s, log.signal("displacement_mm"), color=MEASURED, lw=1.8, label="measured")
    line(upper, time_s, log.signal("estimated_mm"), color=ESTIMATED, lw=0.9, label="estimated")
    line(upper, time_s, log.signal("reference_mm"), color=WANTED, ls="--", lw=1.0, label="reference")
    upper.set_ylabel("displacement / mm")
    legend(upper)
    for ax in lower:
        draw_error(ax, log, MEASURED)
    figure.axes[-1].set_xlabel("time / s")
    error = f"Error = reference − displacement. {NOT_SCORED}"
    return Plot("Tracking", figure, error if is_scored else f"No error is shown: {tracking_caveats(log)[-1]}.")


def draw_error(ax: Axes, log: Log, colour: str) -> None:
    """The error that is scored, and the approach, shaded, that is not."""
    line(ax, log.column("time_s"), error_percent(log), color=colour, lw=0.9)
    ax.axhline(0.0, color=WANTED, lw=0.6)
    ax.axvspan(0.0, logged_reference(log).scored_from_s, color="#f0f2f5", lw=0)
    ax.set_ylabel("error / % of stroke")


def _heat(log: Log) -> Plot:
    time_s, limits = log.column("time_s"), logged_rig(log).limits
    figure, (upper, lower) = panels((2.6, 1.9))
    line(upper, time_s, log.signal("temperature_c"), color=FAINT, lw=1.6, label="thermocouple")
    line(upper, time_s, log.signal("estimated_c"), color=ESTIMATED, lw=1.1, label="wire, estimated")
    line(upper, time_s, log.signal("setpoint_c"), color=WANTED, ls="--", lw=0.8, label="wanted")
    upper.axhline(limits.temperature_max_c, color=LIMIT, ls=":", lw=1.2, label="trip limit")
    upper.set_ylabel("temperature / °C")
    legend(upper)
    _shade(lower, time_s, log.column("limited") > 0)
    line(lower, time_s, log.signal("commanded_a"), color=WANTED, lw=0.7, label="commanded")
    line(lower, time_s, log.signal("current_a"), color=MEASURED, lw=1.0, label="measured")
    lower.axhline(limits.current_max_a, color=LIMIT, ls=":", lw=1.2, label="limit")
    lower.set(ylabel="current / A", xlabel="time / s", ylim=(-0.03 * limits.current_max_a, 1.08 * limits.current_max_a))
    legend(lower)
    return Plot(
        "Heat",
        figure,
        "What the driver wanted, believed and measured, and the current it gave; shaded: it was at a limit.",
    )


def _plane(log: Log) -> Plot:
    figure, (ax,) = panels((4.6,))
    every = max(1, log.column("time_s").size // PLANE_POINTS)
    temperature_c = log.signal("estimated_c")[::every]
    dots = ax.scatter(
        temperature_c,
        log.signal("displacement_mm")[::every],
        c=log.column("time_s")[::every],
        s=4,
        cmap="viridis",
        linewidths=0,
        rasterized=True,
        label="measured",
    )
    figure.colorbar(dots, ax=ax, label="time / s", pad=0.01, aspect=30).outline.set_visible(False)
    caption = "The displacement that was measured over the temperature that the driver believed the wire had."
    if "wire" in log.about:
        _branches(ax, logged_wire(log).model)
        caption += " Lines: the major loop of its model; inside it run the minor loops."
        legend(ax)
    ax.set(xlabel="wire temperature / °C", ylabel="displacement / mm")
    return Plot("Temperature and displacement", figure, caption)


def _branches(ax: Axes, model: HysteresisModel) -> None:
    """The major loop, cut where nothing moves any more."""
    up = np.linspace(*model.input_range, 800)
    loop = model.simulate(np.concatenate((up, up[::-1])))
    heating, cooling = loop[:800], loop[800:][::-1]
    moving = np.abs(heating - cooling) > 2e-3 * abs(model.scale)
    shown = slice(max(int(np.argmax(moving)) - 60, 0), 800 - max(int(np.argmax(moving[::-1])) - 60, 0))
    ax.plot(up[shown], heating[shown], color=HEATING, lw=1.4, label="model, heating")
    ax.plot(up[shown], cooling[shown], color=COOLING, lw=1.4, label="model, cooling")


def _timing(log: Log) -> Plot:
    time_s, period_ms = log.column("time_s"), 1e3 / logged_rig(log).rate_hz
    figure, (*upper, lower) = panels((1.5,) if is_virtual(log) else (1.5, 1.5))
    for ax in upper:
        line(ax, time_s, 1e3 * log.column("late_s"), color=MEASURED, lw=0.8)
        ax.set(ylabel="late / ms", ylim=(0.0, max(1.0, 1.1e3 * log.column("late_s").max())))
    line(lower, time_s[1:], 1e3 * np.diff(time_s), color=MEASURED, lw=0.8)
    lower.axhline(period_ms, color=WANTED, ls="--", lw=0.8)
    lower.set(
        ylabel="spacing / ms", xlabel="time / s", ylim=(0.0, 1.1e3 * np.diff(time_s).max(initial=0.001 * period_ms))
    )
    lateness = (
        "Virtual time has no lateness: it waits for every tick. How far each measurement is from the one before"
        if is_virtual(log)
        else "How long after its deadline each tick began, and how far its measurement is from the one before"
    )
    return Plot(
        "Loop timing",
        figure,
        f"{lateness}: {period_ms:g} ms when all is well; a lost exchange leaves a gap of two periods.",
    )


def _shade(ax: Axes, time_s: Array, where: NDArray[np.bool_]) -> None:
    """Shade the stretches of time in which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(np.int8)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        ax.axvspan(time_s[begin], time_s[min(end, time_s.size - 1)], color="#fdf0d5", lw=0)
