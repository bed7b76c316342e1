"""The page of `smadrive watch`: measured values over time, without any control."""

from __future__ import annotations

from itertools import chain

from bokeh.document import Document

from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.page.panel import LoopTiming, watch_banner_html, watch_chips_html
from smadrive.tuning.page.view.document import FRAME_MS, TIMING_FRAMES, fill, show_text, text_block
from smadrive.tuning.page.view.live_numbers import LiveNumbers, measured_numbers
from smadrive.tuning.page.view.sample_history import SampleHistory
from smadrive.tuning.page.view.time_plots import POINTS, TimePlots, following_axis, show_time_axis
from smadrive.tuning.page.view.time_view import TimeView

SHORTEST_MM, SHORTEST_K = 0.1, 5.0
"""The shortest axes of displacement and temperature."""


class WatchPage:
    """The bokeh document of one client. Every client sees all samples, also those from before its page was opened."""

    def __init__(self, doc: Document, clients: ClientRegistry, history: SampleHistory) -> None:
        self._clients = clients
        client, status = doc.session_context.id, clients.status
        limits = status["limits"]
        self._plots = TimePlots(
            limits["current_max_a"],
            limits["temperature_max_c"],
            following_axis(SHORTEST_MM),
            following_axis(SHORTEST_K),
        )
        show_time_axis(self._plots.figures[-1])
        self._view = TimeView(self._plots, history)
        self._texts = {name: text_block(name) for name in ("chips", "banner")}
        self._numbers = LiveNumbers(1.0 / status["rate_hz"], measured_numbers)
        self._timing = LoopTiming(1.0 / status["rate_hz"])
        self._timing_text = ""
        self._frame = 0
        self._seen = max(0, clients.channel.written - POINTS)
        roots = chain(self._plots.figures, self._view.buttons.values(), self._texts.values())
        fill(doc, roots, self._numbers, status["rig"], controls=False)
        clients.enter(client)
        self._draw()
        doc.add_periodic_callback(self._draw, FRAME_MS)
        doc.on_session_destroyed(lambda _: clients.leave(client))

    def _draw(self) -> None:
        status = self._clients.status
        self._seen, rows = self._clients.channel.since(self._seen)
        self._numbers.update(rows)
        self._view.update(status)  # before the new rows move the window that the user may have dragged
        if rows.size:
            if self._view.follows:
                self._plots.add(rows)
            self._timing.add(rows)
        if self._frame % TIMING_FRAMES == 0:
            self._timing_text = str(self._timing)
        self._frame += 1
        show_text(self._texts["chips"], watch_chips_html(status, self._timing_text, late=self._timing.missed > 0))
        show_text(self._texts["banner"], watch_banner_html(status))
        self._texts["banner"].visible = bool(self._texts["banner"].text)
