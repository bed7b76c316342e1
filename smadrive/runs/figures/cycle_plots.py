"""The plot of a cycling run: stroke, errors, resistance at rest, energy and temperature over the cycles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import MaxNLocator

from smadrive.display.colours import ESTIMATED, LIMIT, MEASURED, SETPOINT
from smadrive.runs.cycling.cycles import CycleMetrics
from smadrive.runs.plot_style import legend, line, panels
from smadrive.runs.report import Plot

CURVES = (
    ("stroke / mm", (("stroke_mm", "", MEASURED),)),
    ("error / % of stroke", (("max_percent", "largest", ESTIMATED), ("rms_percent", "RMS", MEASURED))),
    ("at rest / Ω", (("rest_ohm", "", SETPOINT),)),
    ("energy / J", (("energy_j", "", MEASURED),)),
    ("highest / °C", (("temperature_max_c", "", LIMIT),)),
)
"""For each panel its label, and its curves: metric, name, colour."""


def cycle_plot(cycles: Sequence[CycleMetrics], continued_after: int) -> Plot:
    """Return the plot over the cycles.

    A dotted line after cycle `continued_after` marks the continuation; 0 draws no line.
    """
    number = np.array([one.cycle for one in cycles], np.float64)
    columns = {name: np.array([getattr(one, name) for one in cycles]) for _, curves in CURVES for name, *_ in curves}
    measured = {name for name, values in columns.items() if np.isfinite(values).any()}
    shown = [(label, curves) for label, curves in CURVES if any(name in measured for name, *_ in curves)]
    figure, axes = panels([1.35] * len(shown))
    look = {"marker": ".", "ms": 4.0} if len(cycles) <= 100 else {}
    for ax, (label, curves) in zip(axes, shown, strict=True):
        for name, title, colour in curves:
            line(ax, number, columns[name], color=colour, lw=1.1, label=title, **look)
        ax.set_ylabel(label)
        ax.ticklabel_format(useOffset=False, axis="y")
        if len(curves) > 1:
            legend(ax)
        if continued_after:
            ax.axvline(continued_after + 0.5, color=LIMIT, ls=":", lw=1.0)
    axes[-1].set_xlabel("cycle")
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    caption = "Metrics of each complete cycle. At rest: resistance near the cold end of the reference, leads included."
    return Plot("Cycles", figure, f"{caption} Dotted: here the run was resumed." if continued_after else caption)
