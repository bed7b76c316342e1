"""The plots of a campaign: distribution of the metric, its values along each axis, sensitivity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from smadrive.campaigns.experiments.columns import COLUMNS, labelled
from smadrive.campaigns.plan.axes import Axis
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.results.sensitivity import ColumnShare
from smadrive.campaigns.results.summary import level_text
from smadrive.display.colours import FAINT, LIMIT, MEASURED, SETPOINT
from smadrive.numerics.arrays import FloatArray
from smadrive.runs.plot_style import legend, panels
from smadrive.runs.report import Plot

if TYPE_CHECKING:
    from pandas import DataFrame

BINS = 40
MOST_LEVELS = 24
"""An axis with more values gets no plot: its boxes would be too narrow."""

WIDE_RATIO = 30.0
"""Positive values whose ratio of largest to smallest is above this factor are shown on a logarithmic axis."""


def distribution_plot(table: DataFrame, metric: str) -> Plot:
    """Return the histogram of the metric over all runs that have a value, with median, 90 % quantile and largest value.

    At least one run must have a value.
    """
    values = _finite(table, metric)
    figure, (ax,) = panels((2.6,))
    low, high = float(values.min()), float(values.max())
    wide = low > 0 and high > WIDE_RATIO * low
    edges = np.geomspace(low, high, BINS + 1) if wide else np.linspace(low, high or 1.0, BINS + 1)
    ax.hist(values, bins=edges.tolist() if high > low else 10, color=MEASURED, alpha=0.75)
    ax.set_axisbelow(True)
    marks = {"median": (50, SETPOINT, "-"), "90 % of these runs": (90, SETPOINT, "--"), "worst": (100, LIMIT, ":")}
    for label, (percentile, colour, style) in marks.items():
        value = float(np.percentile(values, percentile))
        ax.axvline(value, color=colour, ls=style, lw=1.2, label=f"{label}: {value:.3g}")
    ax.set(xlabel=labelled(metric), ylabel="runs", xscale="log" if wide else "linear")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    legend(ax)
    return Plot("Distribution", figure, f"{COLUMNS[metric].what}: all {values.size} runs that have a value.")


def axis_plots(plan: CampaignPlan, table: DataFrame, metric: str) -> Iterator[Plot]:
    """Yield a plot for each axis except random wires and repeats: the distribution of the metric at each value.

    An axis with one value, or with more than `MOST_LEVELS` values, gets no plot.
    """
    for axis in plan.axes:
        if not axis.is_sample and 1 < len(axis.levels) <= MOST_LEVELS:
            yield _axis_plot(axis, table, metric)


def sensitivity_plot(found: Sequence[ColumnShare], metric: str) -> Plot:
    """Return the plot of the columns, ranked by their share of the rank variance of the metric."""
    shown = list(reversed(found))
    figure, (ax,) = panels((0.28 * len(shown) + 0.6,))
    ax.barh([one.column for one in shown], [100.0 * one.share for one in shown], color=MEASURED, height=0.6)
    ax.set_axisbelow(True)
    ax.set(xlabel=f"share of the rank variance of {metric} / %", xlim=(0.0, 100.0))
    caption = (
        "Share of the variance of the metric's rank that belongs to each axis, or to each property of a random wire. "
        "Effects that only occur together are in no share."
    )
    return Plot("Sensitivity", figure, caption)


def _axis_plot(axis: Axis, table: DataFrame, metric: str) -> Plot:
    groups = [_finite(table[table[axis.name] == level], metric) for level in axis.levels]
    figure, (ax,) = panels((2.8,))
    drawn = [(place, group) for place, group in enumerate(groups) if group.size]
    if drawn:
        places, values = zip(*drawn, strict=True)
        ax.boxplot(
            values,
            positions=places,
            widths=0.5,
            whis=(5, 95),
            flierprops={"marker": ".", "markersize": 3, "markeredgecolor": FAINT},
            medianprops={"color": LIMIT},
        )
    ax.set_xticks(range(len(axis.levels)), [level_text(level) for level in axis.levels])
    everything = np.concatenate(groups)
    if everything.size and everything.min() > 0 and everything.max() > WIDE_RATIO * everything.min():
        ax.set_yscale("log")
    ax.set(xlabel=axis.name, ylabel=labelled(metric))
    caption = "Box: quarter to three quarters of the runs, with the median; whiskers: 5 to 95 %; dots: the others."
    return Plot(f"By {axis.name}", figure, caption)


def _finite(table: DataFrame, metric: str) -> FloatArray:
    values: FloatArray = table[metric].to_numpy(dtype=np.float64)
    return values[np.isfinite(values)]
