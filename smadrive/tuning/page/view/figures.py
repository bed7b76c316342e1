"""The look of the figures of the page: an empty figure, lines over time, a limit."""

from __future__ import annotations

from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from smadrive.display.colours import PAGE_AXIS, PAGE_GRID, PAGE_LIMIT, PAGE_SOFT_TEXT

WIDTHS = (5.0, 2.8, 1.0)
"""Widths of the lines of one plot, from the lowest to the uppermost."""


def plain_figure(name: str, label: str, tools: str = "", **ranges: object) -> figure:
    """Return an empty figure in the style of the page. `label` is the label of the vertical axis."""
    plot = figure(
        name=name,
        sizing_mode="stretch_both",
        min_height=90,
        toolbar_location=None,
        tools=tools,
        active_scroll="xwheel_zoom" if tools else None,
        output_backend="canvas",
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        **ranges,
    )
    plot.yaxis.axis_label = label
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = plot.axis.major_label_text_font_size = "11px"
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = PAGE_SOFT_TEXT
    plot.axis.axis_line_color = plot.axis.major_tick_line_color = PAGE_AXIS
    plot.axis.minor_tick_line_color = None
    plot.grid.grid_line_color = PAGE_GRID
    plot.min_border_left, plot.min_border_right = 58, 12  # the time axes are aligned
    return plot


def lines(plot: figure, source: ColumnDataSource, **traces: str) -> None:
    """Draw a line over time for each trace. A trace is the name of a column of `source`, and its colour.

    Later lines are thinner and on top of earlier lines, so that every line stays visible.
    """
    for column, colour, width in zip(traces, traces.values(), WIDTHS[-len(traces) :], strict=True):
        plot.line("time_s", column, source=source, color=colour, line_width=width)


def limit(plot: figure, at: float) -> None:
    """Draw a limit as a dashed horizontal line at the value `at`."""
    plot.add_layout(Span(location=at, dimension="width", line_color=PAGE_LIMIT, line_dash="dashed", line_width=1.5))
