"""The page of one client: it shows what the driver publishes, and sends the requests of the user.

Every `FRAME_MS` the page draws the content of the channel. So all pages show the same, also pages that were opened
later.
"""

from __future__ import annotations

import json
from concurrent.futures import BrokenExecutor, Future
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from bokeh.document import Document

from smadrive.errors import SmadriveError
from smadrive.hysteresis.model_file import parse_model
from smadrive.tuning.page.client_registry import WATCHES, ClientRegistry
from smadrive.tuning.page.controls import Controls
from smadrive.tuning.page.fit import Fitter
from smadrive.tuning.page.panel import banner_html, chips_html, events_html, scores_html
from smadrive.tuning.page.rules_table import LAWS
from smadrive.tuning.page.save import save_tuning
from smadrive.tuning.page.view.document import FRAME_MS, fill, show_text, text_block
from smadrive.tuning.page.view.live_numbers import LiveNumbers, tracking_numbers
from smadrive.tuning.page.view.live_samples import LiveSamples
from smadrive.tuning.page.view.plots import Plots
from smadrive.tuning.page.view.sample_history import SampleHistory
from smadrive.tuning.page.view.time_plots import POINTS
from smadrive.tuning.page.view.time_view import TimeView
from smadrive.wire.identified_wire import IdentifiedWire

STATE_FRAMES = 2
"""The hysteresis plane, the texts and the widgets change slowly: they are drawn once in this number of frames."""

_SPREAD = {"mu_heating": 15.0, "mu_cooling": 15.0}
"""Range of these sliders, in °C to either side of the first value: the value in force when the page was opened.

The slider of the feedforward share ranges from 0 to 1.5. All other sliders range from a third of the first value to
three times the first value.
"""


class Page:
    """The bokeh document of one client, with its figures, widgets and texts."""

    def __init__(
        self,
        doc: Document,
        clients: ClientRegistry,
        fitter: Fitter,
        history: SampleHistory,
        folder: Path,
        rig_file: Path,
    ) -> None:
        self._doc, self._clients, self._fitter = doc, clients, fitter
        self._folder, self._rig_file = folder, rig_file
        context = doc.session_context
        self._client = context.id
        token = context.request.arguments.get("token", [b""])[0].decode()
        self._has_token = clients.may_control(token)
        status = clients.status
        self._plots = Plots(status["limits"]["current_max_a"], status["limits"]["temperature_max_c"])
        self._controls = Controls(self._act, status["references"])
        self._texts = {name: text_block(name) for name in ("chips", "banner", "events", "scores")}
        self._view = TimeView(self._plots, history)
        period_s = 1.0 / status["rate_hz"]
        numbers = LiveNumbers(period_s, lambda row: tracking_numbers(row, self._plots.stroke_mm))
        self._samples = LiveSamples(clients.channel, self._plots, self._view, numbers, period_s)
        self._note = ""
        self._fits: dict[Future[IdentifiedWire], float] = {}
        self._seen_on_plane = max(0, clients.channel.written - POINTS)
        self._shown: dict[str, Any] = {}
        self._frame = 0
        self._show_model(status["tuning"])  # before the first rows: errors are drawn in percent of the model's stroke
        self._bound_knobs(status["tuning"])
        parts = self._plots.figures, self._controls.roots, self._view.buttons.values(), self._texts.values()
        fill(doc, chain.from_iterable(parts), numbers, status["rig"], controls=True)
        clients.enter(self._client)
        self._draw()
        doc.add_periodic_callback(self._draw, FRAME_MS)
        doc.on_session_destroyed(lambda _: clients.leave(self._client))

    def _draw(self) -> None:
        self._controls.events.set_offs(self._clients.channel.offs)
        self._samples.draw(self._clients.status)
        if self._frame % STATE_FRAMES == 0:
            self._draw_state()
        self._frame += 1

    def _draw_state(self) -> None:
        status = self._clients.status
        for fitting in [one for one in self._fits if one.done()]:
            self._fitted(self._fits.pop(fitting), fitting)
        controls = self._has_token and self._clients.claim(self._client)
        self._seen_on_plane, rows = self._clients.channel.since(self._seen_on_plane)
        if rows.size:
            self._plots.show_state(rows)
        if status["tuning"] != self._shown:
            self._show_model(status["tuning"])
        self._plots.show_turning_points((status["turning_points"] or {}).get("temperatures_c", []))
        self._show_knobs(status["tuning"])
        self._controls.enable(controls, status=status)
        show_text(
            self._texts["chips"],
            chips_html(status, self._samples.timing, late=self._samples.is_late, controls=controls),
        )
        show_text(self._texts["banner"], banner_html(status, self._note))
        self._texts["banner"].visible = bool(self._texts["banner"].text)
        show_text(self._texts["events"], events_html(status["events"]))
        show_text(self._texts["scores"], scores_html(status["comparison"]))

    def _show_model(self, tuning: dict[str, Any]) -> None:
        if tuning["wire"] != self._shown.get("wire"):
            model = parse_model(tuning["wire"], place="the wire in force")
            self._plots.show_model(model, tuning["travel_mm"])
            document = json.loads(tuning["wire"])
            if "sets" in document:
                self._controls.rules.show(document["sets"]["centres"], {law: document[law] for law in LAWS})
        self._shown = tuning

    def _show_knobs(self, tuning: dict[str, Any], *, now: bool = False) -> None:
        """Show the values in force, except on a knob that the user has just moved. With `now`, show all."""
        for name, value in {**tuning["shape"], **tuning["feedback"]}.items():
            if name in self._controls.knobs:
                self._controls.knobs[name].show(value, now=now)
        self._controls.source.show(tuning["displacement_from"], now=now)

    def _bound_knobs(self, tuning: dict[str, Any]) -> None:
        for name, knob in self._controls.knobs.items():
            value = {**tuning["shape"], **tuning["feedback"]}[name]
            if name == "feedforward_share":
                knob.bound(0.0, 1.5)
            elif name in _SPREAD:
                knob.bound(round(value - _SPREAD[name]), round(value + _SPREAD[name]))
            else:
                knob.bound(*sorted((value / 3.0, value * 3.0)))

    def _act(self, act: str, **values: Any) -> None:
        """Do the action `act` of a widget, or refuse it if this client does not control."""
        if not self._clients.controls(self._client):
            self._answered(act, WATCHES)
            return
        match act:
            case "fit":
                self._fit(**values)
            case "save":
                self._save(**values)
            case _:
                self._send(act, **values)

    def _send(self, act: str, **values: Any) -> None:
        self._clients.ask(self._client, act, partial(self._answered, act), **values)

    def _answered(self, act: str, refused: str | None) -> None:
        """Clear the note of this page if the action `act` was done. If it was refused, schedule `_show_refusal`.

        Answers arrive outside of the document's own callbacks, and only these callbacks may change the document.
        """
        if refused:
            self._doc.add_next_tick_callback(partial(self._show_refusal, f"{act}: {refused}"))
        else:
            self._note = ""

    def _show_refusal(self, note: str) -> None:
        """Show `note` in the banner, and the values in force on the widgets.

        The OFF count is sent to the browser before the note. So when the user reads "press again" in the note, the next
        click carries the present count.
        """
        self._controls.events.resend_offs(self._clients.channel.offs)
        self._note = note
        self._shown = {}
        self._show_model(self._clients.status["tuning"])
        self._show_knobs(self._clients.status["tuning"], now=True)

    def _fit(self, seconds: float) -> None:
        """Begin to fit a model to the last `seconds`. After the fit, `_draw_state` sends the model as a request."""
        (_, rows), wire = self._clients.channel.since(0), self._clients.status["tuning"]["wire"]
        try:
            fitting = self._fitter.fit(rows, seconds, wire)
        except SmadriveError as error:
            self._report_unfitted(str(error))
            return
        self._note = f"fitting the last {seconds:g} s …"
        self._fits[fitting] = seconds

    def _fitted(self, seconds: float, fitting: Future[IdentifiedWire]) -> None:
        try:
            wire = fitting.result()
            self._send("model", text=wire.text(), caveats=wire.caveats, source=f"fit to the last {seconds:g} s")
        except SmadriveError as error:
            self._report_unfitted(str(error))
        except BrokenExecutor:
            self._report_unfitted(f"the process that fitted the last {seconds:g} s died: fit again")

    def _report_unfitted(self, reason: str) -> None:
        """Report a failed fit among the events, which all pages show, and in the note of this page."""

        def noted(_refused: str | None) -> None:
            self._note = f"fit: {reason}"

        self._clients.ask(self._client, "note", noted, text=f"not fitted: {reason}")

    def _save(self, name: str) -> None:
        try:
            files = save_tuning(self._folder, name.strip(), self._rig_file, self._clients.status)
        except SmadriveError as error:
            self._note = f"save: {error}"
            return
        note = f"saved: {files[0]} and {files[1]}"

        def noted(_refused: str | None) -> None:
            self._note = note

        noted(None)
        self._clients.ask(self._client, "note", noted, text=f"saved as {files[0].name} and {files[1].name}")
