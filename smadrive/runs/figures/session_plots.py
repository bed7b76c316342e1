"""The plot of a tuning session: displacement over time, the modes, and the changes that were put in force."""

from __future__ import annotations

from matplotlib.axes import Axes

from smadrive.display.colours import ARMING, ESTIMATED, FAINT, HEATING, HOLDING, LIMIT, MEASURED, RULE, SETPOINT
from smadrive.runs.columns import COLUMNS
from smadrive.runs.log.reader import Log
from smadrive.runs.plot_style import legend, line, panels
from smadrive.runs.report import Grid, Plot
from smadrive.runs.session_record import spans_of, tunings_of

_COLOURS = {
    "idle": RULE,
    "ended": RULE,
    "arming": ARMING,
    "holding": HOLDING,
    "tracking": ESTIMATED,
    "comparing": MEASURED,
    "tripped": LIMIT,
}
"""The colours of the modes, in the order of the legend."""

MOST_NUMBERS = 40
"""If a session has more changes, the plot shows the changes without their numbers."""


def session_plot(log: Log) -> Plot:
    """Return the plot of displacement, modes and changes over time."""
    figure, (upper, lower) = panels((3.2, 0.7))
    time_s = log.column("time_s")
    lines = (("displacement_mm", MEASURED, 1.8), ("estimated_mm", ESTIMATED, 0.9), ("setpoint_mm", SETPOINT, 1.0))
    for name, colour, width in lines:
        facts = COLUMNS[name]
        line(upper, time_s, log.column_with_gaps(name), label=facts.role, color=colour, lw=width)
        upper.set_ylabel(facts.axis_label)
    _mark_changes(upper, log)
    if upper.get_legend_handles_labels()[0]:
        legend(upper)
    _draw_modes(lower, log)
    lower.set_xlabel(COLUMNS["time_s"].axis_label)
    return Plot(
        "Session",
        figure,
        "Displacement, and the mode of the session below it. Each dotted line is a change that was put in force, with "
        "its number in the table of changes.",
    )


def change_table(log: Log) -> Grid:
    """Return the table of the tunings that were in force."""
    rows = [
        (str(number), f"{put.time_s:.2f}\N{NO-BREAK SPACE}s", put.change, str(put.model), put.values)
        for number, put in enumerate(tunings_of(log))
    ]
    return Grid(("", "time", "change", "model", "values in force"), rows, "Changes", texts=True)


def _mark_changes(ax: Axes, log: Log) -> None:
    changes = tunings_of(log)[1:]
    for number, put in enumerate(changes, 1):
        ax.axvline(put.time_s, color=FAINT, ls=":", lw=1.0)
        if len(changes) <= MOST_NUMBERS:
            place = ax.get_xaxis_transform()
            ax.text(put.time_s, 0.99, f" {number}", transform=place, va="top", fontsize=8, color=HEATING)


def _draw_modes(ax: Axes, log: Log) -> None:
    spans = list(spans_of(log))
    for mode, colour in _COLOURS.items():
        of_mode = [(span.from_s, span.to_s - span.from_s) for span in spans if span.mode == mode]
        if sum(width for _, width in of_mode) > 0.0:
            ax.broken_barh(of_mode, (0.0, 1.0), color=colour, label=mode, lw=0)
    ax.set(ylim=(0.0, 1.0), yticks=[], ylabel="mode")
    if ax.get_legend_handles_labels()[0]:
        legend(ax)
