"""The window of time that one page shows: the newest minute while it follows the run, or any part of the session.

A page stops following the run when the user presses a button such as Pause or Back, drags or zooms a plot, and when a
fault ends the run. It follows the run again after Resume; after a fault it also follows when the heater is armed again.
The run does not depend on what a page shows.
"""

from __future__ import annotations

from math import isclose
from typing import Any

from bokeh.models import Button

from smadrive.stream.published_state import PublishedMode
from smadrive.tuning.page.knob import COMPACT
from smadrive.tuning.page.view.sample_history import SampleHistory
from smadrive.tuning.page.view.time_plots import POINTS, SHORTEST_S, WINDOW_S, TimePlots

BEFORE_S, AFTER_S = 62.0, 3.0
"""After a fault, the page shows the samples from BEFORE_S before the fault to AFTER_S after it."""

REFUSALS = ("SafetyError", "ConfigError")
"""Types of faults after which the page still follows. Usually such a fault refuses to arm, and nothing was heated."""

NARROW = ":host { min-width: 0; } .bk-btn { padding: 2px 0; }"
"""Style that fits all buttons into one row of 400 pixels."""

STEP = 0.5
"""Share of the window by which Back and Forward move it."""


class TimeView:
    """Chooses the window of time in `history` that `plots` show, and has the buttons for this choice."""

    def __init__(self, plots: TimePlots, history: SampleHistory) -> None:
        self._plots = plots
        self._history = history
        self._window: tuple[float, float] | None = None
        self._drawn_to_s = float("inf")
        self._frozen_at_s: float | None = None
        self.buttons = {
            "pause": self._button("pause", "Pause", self._switch),
            "back": self._button("back", "◀ Back", lambda: self._move(-STEP)),
            "forward": self._button("forward", "Forward ▶", lambda: self._move(STEP)),
            "closer": self._button("closer", "Zoom in", lambda: self._zoom(0.5)),
            "wider": self._button("wider", "Zoom out", lambda: self._zoom(2.0)),
            "whole": self._button("whole", "All", lambda: self.show(*self._history.ends_s)),
        }

    @property
    def follows(self) -> bool:
        """True if the page shows the newest minute."""
        return self._window is None

    def update(self, status: dict[str, Any]) -> None:
        """Stop following at a new fault. Follow again when the heater is armed. Draw a window that the user moved."""
        fault_s = None if status["fault_type"] in REFUSALS else status["fault_s"]
        if fault_s is not None and fault_s != self._frozen_at_s:
            self._frozen_at_s = fault_s
            self.show(fault_s - BEFORE_S, fault_s + AFTER_S)
        elif self._frozen_at_s is not None and PublishedMode(status["mode"]).heats:
            self._frozen_at_s = None
            self.follow()
        shown = self._plots.window
        if not _are_close(shown, self._window or self._plots.followed):
            self.show(*shown)
        elif self._window is not None and self._drawn_to_s < self._window[1]:
            self._draw(*self._window)  # samples of this window have arrived in the meantime

    def show(self, from_s: float, to_s: float) -> None:
        """Stop following the run, and show the samples from `from_s` to `to_s`."""
        self._window = from_s, max(to_s, from_s + SHORTEST_S)
        self._draw(*self._window)
        self.buttons["pause"].label = "Resume"

    def follow(self) -> None:
        """Show the newest minute, and follow the run."""
        self._window = None
        newest_s = self._history.ends_s[1]
        self._plots.show_rows(self._history.window(newest_s - WINDOW_S, newest_s, POINTS), None)
        self.buttons["pause"].label = "Pause"

    def _draw(self, from_s: float, to_s: float) -> None:
        self._plots.show_rows(self._history.window(from_s, to_s, POINTS), (from_s, to_s))
        self._drawn_to_s = self._history.ends_s[1]

    def _switch(self) -> None:
        if self.follows:
            self.show(*self._plots.window)
        else:
            self.follow()

    def _move(self, share: float) -> None:
        from_s, to_s = self._plots.window
        by_s = share * (to_s - from_s)
        self.show(from_s + by_s, to_s + by_s)

    def _zoom(self, factor: float) -> None:
        from_s, to_s = self._plots.window
        middle_s, half_s = 0.5 * (from_s + to_s), 0.5 * factor * (to_s - from_s)
        self.show(middle_s - half_s, middle_s + half_s)

    def _button(self, name: str, label: str, pressed: Any) -> Button:
        button = Button(label=label, name=name, sizing_mode="stretch_width")
        button.update(margin=1, stylesheets=[COMPACT, NARROW])
        button.on_click(lambda _event: pressed())
        return button


def _are_close(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return all(isclose(a, b, abs_tol=1e-3) for a, b in zip(one, other, strict=True))
