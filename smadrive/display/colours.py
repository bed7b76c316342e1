"""The colours of plots and pages, by their meaning. A meaning has the same colour in every plot of a report or card.

The tuning page has a palette of its own, `PAGE_…`; its files page.html and panel.css write the same colours.
A card may stand on a dark page, so its setpoint has the colour of the page's text instead: `line_plot.INK`.
"""

from __future__ import annotations

SETPOINT = TEXT = "#1f2933"
MEASURED = COOLING = LINK = "#1d6fb8"
ESTIMATED = "#e07b16"
LIMIT = HEATING = BAD = "#c8323c"
GOOD = "#1e8e4e"
WARNING = "#e0a116"
CARD_WARNING = "#b7791f"
"""The text of a warning in a card: it can be read on light and on dark pages."""

RUN_COLOURS = (MEASURED, ESTIMATED, GOOD, "#8e44ad", BAD, "#17a2a2", "#7a5c2e", "#d6589f")
"""The colours of runs side by side, in their order."""

AXIS_LABEL = "#323f4b"
SOFT_TEXT = "#52606d"
CAPTION = "#616e7c"
RECORD = AXIS = "#7b8794"
FAINT = "#a9b4c0"
RULE = "#e4e7eb"
"""Thin lines: the grid of a plot, the lines of a table."""

SHADE = "#f0f2f5"
"""The band of the approach, which is not scored, and of the errors that the paper reports."""

PANEL = "#f5f7fa"
AT_LIMIT = ARMING = "#fdf0d5"
HOLDING = "#f2c879"
GOOD_SHADE, WARNING_SHADE, BAD_SHADE = "#e9f7ef", "#fff6e5", "#fdecec"

PAGE_SETPOINT = "#22303c"
PAGE_MEASURED = PAGE_ACCENT = "#0b8f87"
"""Measured values, and active controls."""

PAGE_ESTIMATED = "#e8890c"
PAGE_HEATING, PAGE_COOLING = "#d1495b", "#3a7ca5"
PAGE_LIMIT = "#c0392b"
PAGE_SOFT_TEXT, PAGE_AXIS, PAGE_GRID = "#5b6b79", "#c3ccd4", "#e6eaee"
