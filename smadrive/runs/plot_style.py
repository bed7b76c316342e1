"""The look of every plot: one style, and lines with few points even for a long run."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from smadrive.display.colours import AXIS, AXIS_LABEL, RULE, SOFT_TEXT
from smadrive.numerics.arrays import FloatArray

STYLE: Any = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": AXIS,
    "axes.labelcolor": AXIS_LABEL,
    "axes.grid": True,
    "grid.color": RULE,
    "xtick.color": SOFT_TEXT,
    "ytick.color": SOFT_TEXT,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "smadrive",
}

WIDTH_IN = 9.0
"""Width of a figure, inches."""

POINTS = 3000
"""Largest number of points of a line. A line with more points is thinned out: a page has fewer pixels."""


NOTEBOOK_STYLE: Any = {**STYLE, "svg.fonttype": "none", "path.simplify_threshold": 1.0}
"""Text is stored as text, and points that no pixel shows are left out, so that a notebook with plots stays small."""


_COORDINATES = re.compile(r' (?:d|x|y)="[^"]*"')
_DIGITS = re.compile(r"(\.\d\d)\d+")
"""Coordinates keep two decimals (0.01 point), because more than half of a drawing's bytes are digits."""


class PlotFigure(Figure):
    """A figure that a notebook shows as a vector drawing, without pyplot and without a backend."""

    def _repr_svg_(self) -> str:
        """Return the figure as SVG."""
        buffer = io.StringIO()
        with mpl.rc_context(NOTEBOOK_STYLE):
            self.savefig(buffer, format="svg", metadata={"Date": None})
        return _COORDINATES.sub(lambda found: _DIGITS.sub(r"\1", found.group()), buffer.getvalue())


def panels(heights: Sequence[float], *, share_x: bool = True) -> tuple[PlotFigure, list[Axes]]:
    """Return a figure and its panels, which stand one above the other and, with `share_x`, share their horizontal axis.

    `heights` are in inches.
    """
    with mpl.rc_context(STYLE):
        figure = PlotFigure(figsize=(WIDTH_IN, sum(heights) + 0.5), layout="constrained")
        axes = figure.subplots(len(heights), 1, sharex=share_x, squeeze=False, height_ratios=list(heights))
    return figure, list(axes[:, 0])


def side_by_side(count: int, height: float) -> tuple[PlotFigure, list[Axes]]:
    """Return a figure of this height in inches and its panels, which stand side by side and share the vertical axis."""
    with mpl.rc_context(STYLE):
        figure = PlotFigure(figsize=(WIDTH_IN, height), layout="constrained")
        axes = figure.subplots(1, count, sharey=True, squeeze=False)
    return figure, list(axes[0])


def line(ax: Axes, time_s: FloatArray, values: FloatArray, **look: Any) -> None:
    """Draw a line over time, unless no value is finite.

    A line of more than `POINTS` values is reduced to the extremes of short intervals, so that every spike stays.
    """
    if not np.isfinite(values).any():
        return
    shown = _extremes(values)
    ax.plot(time_s[shown], values[shown], **look)


def legend(ax: Axes) -> None:
    """Draw the legend in a row above the panel, where the legend hides no line."""
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=6,
        borderaxespad=0.0,
        handlelength=1.6,
        frameon=False,
        fontsize=9,
    )


def _extremes(values: FloatArray) -> NDArray[np.intp]:
    """Return the indices of the points to plot, in order: at most `POINTS` of them, so that no peak is lost.

    The values are cut into `POINTS`/2 intervals of equal length. Each interval gives the indices of its smallest and of
    its largest value. For at most `POINTS` values, all indices are returned.
    """
    if values.size <= POINTS:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, POINTS // 2 + 1).astype(np.intp)
    low, high = np.where(np.isfinite(values), values, np.inf), np.where(np.isfinite(values), values, -np.inf)
    pairs = [(a + int(np.argmin(low[a:b])), a + int(np.argmax(high[a:b]))) for a, b in pairwise(edges)]
    return np.unique(np.array(pairs).ravel())
