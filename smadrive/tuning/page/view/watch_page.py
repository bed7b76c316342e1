"""The page of `smadrive watch`: measured values over time, without any control."""

from __future__ import annotations

from itertools import chain

from bokeh.document import Document

from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.page.panel import watch_banner_html, watch_chips_html
from smadrive.tuning.page.view.document import FRAME_MS, fill, show_text, text_block
from smadrive.tuning.page.view.live_numbers import LiveNumbers, measured_numbers
from smadrive.tuning.page.view.live_samples import LiveSamples
from smadrive.tuning.page.view.sample_history import SampleHistory
from smadrive.tuning.page.view.time_plots import TimePlots, following_axis, show_time_axis
from smadrive.tuning.page.view.time_view import TimeView

SHORTEST_MM, SHORTEST_K = 0.1, 5.0
"""Shortest span of the displacement axis in mm, and of the temperature axis in K."""


class WatchPage:
    """The bokeh document of one client. Every client sees all samples, also those from before its page was opened."""

    def __init__(self, doc: Document, clients: ClientRegistry, history: SampleHistory) -> None:
        self._clients = clients
        client, status = doc.session_context.id, clients.status
        limits = status["limits"]
        plots = TimePlots(
            limits["current_max_a"],
            limits["temperature_max_c"],
            following_axis(SHORTEST_MM),
            following_axis(SHORTEST_K),
        )
        show_time_axis(plots.figures[-1])
        view, period_s = TimeView(plots, history), 1.0 / status["rate_hz"]
        self._texts = {name: text_block(name) for name in ("chips", "banner")}
        numbers = LiveNumbers(period_s, measured_numbers)
        self._samples = LiveSamples(clients.channel, plots, view, numbers, period_s)
        roots = chain(plots.figures, view.buttons.values(), self._texts.values())
        fill(doc, roots, numbers, status["rig"], controls=False)
        clients.enter(client)
        self._draw()
        doc.add_periodic_callback(self._draw, FRAME_MS)
        doc.on_session_destroyed(lambda _: clients.leave(client))

    def _draw(self) -> None:
        status = self._clients.status
        self._samples.draw(status)
        chips = watch_chips_html(status, self._samples.timing, late=self._samples.is_late)
        show_text(self._texts["chips"], chips)
        show_text(self._texts["banner"], watch_banner_html(status))
        self._texts["banner"].visible = bool(self._texts["banner"].text)
