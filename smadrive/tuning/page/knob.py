"""A knob: one number on the page, with a slider for coarse values and a field for exact values.

A knob shows the value in force. After the user has moved it, the knob keeps the user's value for `HANDS_OFF_S`, so that
the slider does not jump back while the user drags it. After a refusal the knob shows the value in force at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from bokeh.models import Row, Slider, Spinner

from smadrive.display.colours import PAGE_ACCENT

HANDS_OFF_S = 1.0

COMPACT = f"""
:host {{ font-size: 12px; }} .bk-input, .bk-btn {{ min-height: 26px; padding: 2px 8px; }}
.bk-btn-primary, .bk-btn-primary:is(:hover, :active, :focus) {{
  background: {PAGE_ACCENT}; border-color: {PAGE_ACCENT};
}}
.noUi-target:not([disabled]) .noUi-connect {{ background: {PAGE_ACCENT}; }}
"""
"""Style of compact widgets.

Its last line colours the slider: bokeh applies `bar_color` only to a slider that is enabled when it is first drawn.
"""


class Knob:
    """A slider and a field for the value `name`. When the user changes one, `changed(name, value)` is called."""

    def __init__(self, name: str, title: str, step: float, changed: Callable[[str, float], None]) -> None:
        self._name = name
        self._changed = changed
        self._moved_s = float("-inf")
        self._is_showing = False
        self._slider = Slider(
            title=title,
            start=0.0,
            end=1.0,
            value=0.5,
            step=step,
            show_value=False,
            bar_color=PAGE_ACCENT,
            sizing_mode="stretch_width",
        )
        self._field = Spinner(value=0.5, step=step, width=84, format="0.[000]", align="end")
        for widget in (self._slider, self._field):
            widget.update(margin=(1, 4, 1, 4), stylesheets=[COMPACT])
        self._slider.on_change("value", self._moved)
        self._field.on_change("value", self._moved)
        self.row = Row(self._slider, self._field, sizing_mode="stretch_width", name=name)

    def bound(self, low: float, high: float) -> None:
        """Set the ends of the slider. The field also accepts values beyond the ends; the session may refuse them."""
        self._slider.update(start=low, end=high)

    def show(self, value: float, *, now: bool = False) -> None:
        """Show the value in force, unless the user has just moved the knob. With `now`, show it in any case."""
        if not now and time.monotonic() - self._moved_s < HANDS_OFF_S:
            return
        if value != self._field.value:
            self._set(value)

    def enable(self, on: bool) -> None:
        """Enable the knob if `on`, otherwise disable it."""
        self._slider.disabled = self._field.disabled = not on

    def _set(self, value: float) -> None:
        self._is_showing = True
        self._field.value = value
        self._slider.value = min(max(value, self._slider.start), self._slider.end)
        self._is_showing = False

    def _moved(self, _attribute: str, _old: float, value: float | None) -> None:
        if self._is_showing or value is None:
            return
        self._moved_s = time.monotonic()
        self._set(value)
        self._changed(self._name, value)
