"""The choice of the displacement source on the page: one button for each source.

The button of the source in force is shown as pressed. After a click, the clicked button stays pressed for
`HANDS_OFF_S`, because it takes a moment to build the change. After a refusal the source in force is shown at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from bokeh.models import RadioButtonGroup

from smadrive.measurement import DisplacementFrom
from smadrive.tuning.page.knob import COMPACT, HANDS_OFF_S

SOURCES = [source.value for source in DisplacementFrom]


class SourceChoice:
    """The buttons of the sources. When the user presses one, `chosen(source)` is called."""

    def __init__(self, chosen: Callable[[str], None]) -> None:
        self._chosen = chosen
        self._clicked_s = float("-inf")
        self._is_showing = False
        self.widget = RadioButtonGroup(labels=SOURCES, name="source", sizing_mode="stretch_width")
        self.widget.update(margin=(2, 3, 2, 3), stylesheets=[COMPACT])
        self.widget.on_change("active", self._clicked)

    def show(self, source: str, *, now: bool = False) -> None:
        """Show the source in force, unless the user has just chosen one. With `now`, show it in any case."""
        if not now and time.monotonic() - self._clicked_s < HANDS_OFF_S:
            return
        if self.widget.active != SOURCES.index(source):
            self._is_showing = True
            self.widget.active = SOURCES.index(source)
            self._is_showing = False

    def enable(self, on: bool) -> None:
        """Enable the buttons if `on`, otherwise disable them."""
        if self.widget.disabled is on:
            self.widget.disabled = not on

    def _clicked(self, _attribute: str, _old: int | None, active: int | None) -> None:
        if self._is_showing or active is None:
            return
        self._clicked_s = time.monotonic()
        self._chosen(SOURCES[active])
