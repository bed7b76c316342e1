"""The new samples on a page: large numbers, plots over time, and the timing of the loop."""

from __future__ import annotations

from typing import Any

from smadrive.tuning.link.channel import PageEnd
from smadrive.tuning.page.panel import LoopTiming
from smadrive.tuning.page.view.live_numbers import LiveNumbers
from smadrive.tuning.page.view.time_plots import POINTS, TimePlots
from smadrive.tuning.page.view.time_view import TimeView

TIMING_FRAMES = 7
"""The text of the loop timing changes once in this number of frames: a new text makes the browser lay out the page."""


class LiveSamples:
    """Reads the samples from `channel`, and draws the new ones at every frame of one page.

    `timing` is the text of the loop timing.
    """

    def __init__(
        self, channel: PageEnd, plots: TimePlots, view: TimeView, numbers: LiveNumbers, period_s: float
    ) -> None:
        self._channel, self._plots, self._view, self._numbers = channel, plots, view, numbers
        self._timing = LoopTiming(period_s)
        self._seen = max(0, channel.written - POINTS)
        self._frame = 0
        self.timing = ""

    @property
    def is_late(self) -> bool:
        """True if the loop has missed a tick since the first sample that this page has drawn."""
        return self._timing.missed > 0

    def draw(self, status: dict[str, Any]) -> None:
        """Draw the samples since the last call. `status` is the published status."""
        self._seen, rows = self._channel.since(self._seen)
        self._numbers.update(rows)
        self._view.update(status)  # before the new rows move the window that the user may have dragged
        if rows.size:
            if self._view.follows:
                self._plots.add(rows)
            self._timing.add(rows)
        if self._frame % TIMING_FRAMES == 0:
            self.timing = str(self._timing)
        self._frame += 1
