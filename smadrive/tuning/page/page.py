"""The page of one client: it shows what the control process publishes, and passes on what its user asks.

Everything is drawn from the channel at `FRAME_MS`; nothing is kept that a new page could not show as well.
"""

from __future__ import annotations

import json
from concurrent.futures import BrokenExecutor, Future
from functools import partial
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.models import Div

from smadrive.errors import SmadriveError
from smadrive.hysteresis.model_file import parse_model
from smadrive.tuning.page.client_registry import WATCHES, ClientRegistry
from smadrive.tuning.page.controls import LAWS, Controls
from smadrive.tuning.page.fit import Fitter
from smadrive.tuning.page.panel import Timing, banner_html, chips_html, events_html, scores_html
from smadrive.tuning.page.plots import POINTS, Plots
from smadrive.tuning.page.save import save_tuning
from smadrive.wire.identified_wire import IdentifiedWire

HERE = Path(__file__).parent

FRAME_MS = 300
STATE_FRAMES = 2
"""The plane and the texts are drawn every so many frames: they are read, not watched move."""

TIMING_FRAMES = 7
"""The loop's punctuality is told anew every so many frames: every new text lays the page out anew."""

_SPREAD = {"mu_heating": 15.0, "mu_cooling": 15.0}
"""Sliders reach so far to either side of the value the page begins with; the others from a third to three times it."""


class Page:
    """A document with its figures, widgets and texts."""

    def __init__(self, doc: Document, desk: ClientRegistry, fitter: Fitter, folder: Path, rig_file: Path) -> None:
        self._doc, self._desk, self._fitter = doc, desk, fitter
        self._folder, self._rig_file = folder, rig_file
        context = doc.session_context
        self._client = context.id
        token = context.request.arguments.get("token", [b""])[0].decode()
        self._has_token = desk.may_control(token)
        status = desk.status
        self._plots = Plots(status["limits"]["current_max_a"], status["limits"]["temperature_max_c"])
        self._controls = Controls(self._act, status["references"])
        self._texts = {name: _text(name) for name in ("chips", "banner", "events", "scores")}
        self._note = ""
        self._timing = Timing(1.0 / status["rate_hz"])
        self._punctuality = ""
        self._seen = max(0, desk.channel.written - POINTS)
        self._seen_on_plane = self._seen
        self._shown: dict[str, Any] = {}
        self._frame = 0
        self._show_model(status["tuning"])  # before what it drew: errors are told in strokes
        self._bound_knobs(status["tuning"])
        for root in (*self._plots.figures, *self._controls.roots, *self._texts.values()):
            doc.add_root(root)
        doc.title = f"smadrive · {status['rig']}"
        doc.template = (HERE / "page.html").read_text(encoding="utf-8")
        doc.template_variables["rig"] = status["rig"]
        desk.enter(self._client)
        self._draw()
        doc.add_periodic_callback(self._draw, FRAME_MS)
        doc.on_session_destroyed(lambda _: desk.leave(self._client))

    def _draw(self) -> None:
        self._controls.presses.know(self._desk.channel.offs)
        self._seen, rows = self._desk.channel.since(self._seen)
        if rows.size:
            self._plots.add(rows)
            self._timing.add(rows)
        if self._frame % TIMING_FRAMES == 0:
            self._punctuality = str(self._timing)
        if self._frame % STATE_FRAMES == 0:
            self._draw_state()
        self._frame += 1

    def _draw_state(self) -> None:
        status = self._desk.status
        controls = self._has_token and self._desk.claim(self._client)
        self._seen_on_plane, rows = self._desk.channel.since(self._seen_on_plane)
        if rows.size:
            self._plots.show_state(rows)
        if status["tuning"] != self._shown:
            self._show_model(status["tuning"])
        self._show_knobs(status["tuning"])
        self._controls.enable(controls, status=status)
        self._text("chips", chips_html(status, self._punctuality, late=self._timing.missed > 0, controls=controls))
        self._text("banner", banner_html(status, self._note))
        self._text("events", events_html(status["events"]))
        self._text("scores", scores_html(status["comparison"]))

    def _show_model(self, tuning: dict[str, Any]) -> None:
        if tuning["wire"] != self._shown.get("wire"):
            model = parse_model(tuning["wire"], place="the wire in force")
            self._plots.show_model(model, tuning["travel_mm"])
            document = json.loads(tuning["wire"])
            if "sets" in document:
                self._controls.show_rules(document["sets"]["centres"], {law: document[law] for law in LAWS})
        self._shown = tuning

    def _show_knobs(self, tuning: dict[str, Any], *, now: bool = False) -> None:
        """At every drawing: what a knob did not show under a hand it shows as soon as the hand is off."""
        for name, value in {**tuning["shape"], **tuning["feedback"]}.items():
            if name in self._controls.knobs:
                self._controls.knobs[name].show(value, now=now)

    def _bound_knobs(self, tuning: dict[str, Any]) -> None:
        for name, knob in self._controls.knobs.items():
            value = {**tuning["shape"], **tuning["feedback"]}[name]
            if name == "feedforward_share":
                knob.bound(0.0, 1.5)
            elif name in _SPREAD:
                knob.bound(round(value - _SPREAD[name]), round(value + _SPREAD[name]))
            else:
                knob.bound(*sorted((value / 3.0, value * 3.0)))

    def _text(self, name: str, html: str) -> None:
        if self._texts[name].text != html:
            self._texts[name].text = html

    def _act(self, act: str, **values: Any) -> None:
        """The one way from a widget to anything that is done: only for the client that controls."""
        if not self._desk.controls(self._client):
            self._answered(act, WATCHES)
            return
        match act:
            case "fit":
                self._fit(**values)
            case "save":
                self._save(**values)
            case _:
                self._ask(act, **values)

    def _ask(self, act: str, **values: Any) -> None:
        self._desk.ask(self._client, act, partial(self._answered, act), **values)

    def _answered(self, act: str, refused: str | None) -> None:
        """Note a refusal and bring back what is in force; called outside of the document's own turn."""
        self._note = f"{act}: {refused}" if refused else ""
        if refused:
            self._doc.add_next_tick_callback(self._show_again)

    def _show_again(self) -> None:
        self._controls.presses.know_again(self._desk.channel.offs)
        self._shown = {}
        self._show_model(self._desk.status["tuning"])
        self._show_knobs(self._desk.status["tuning"], now=True)

    def _fit(self, seconds: float) -> None:
        """Have a model fitted beside everything else, then ask for it."""
        (_, rows), wire = self._desk.channel.since(0), self._desk.status["tuning"]["wire"]
        try:
            fitting = self._fitter.fit(rows, seconds, wire)
        except SmadriveError as error:
            self._unfit(str(error))
            return
        self._note = f"fitting the last {seconds:g} s …"
        fitting.add_done_callback(lambda done: self._doc.add_next_tick_callback(partial(self._fitted, seconds, done)))

    def _fitted(self, seconds: float, fitting: Future[IdentifiedWire]) -> None:
        try:
            wire = fitting.result()
            self._ask("model", text=wire.text(), caveats=wire.caveats, source=f"fit to the last {seconds:g} s")
        except SmadriveError as error:
            self._unfit(str(error))
        except BrokenExecutor:
            self._unfit(f"the fit to the last {seconds:g} s died with its process: fit again")

    def _unfit(self, reason: str) -> None:
        """Have it told among the events of all pages; on this one it stands whatever becomes of that."""

        def noted(_refused: str | None) -> None:
            self._note = f"fit: {reason}"

        self._desk.ask(self._client, "note", noted, text=f"not fitted: {reason}")

    def _save(self, name: str) -> None:
        try:
            files = save_tuning(self._folder, name.strip(), self._rig_file, self._desk.status)
        except SmadriveError as error:
            self._note = f"save: {error}"
            return
        self._note = f"saved: {files[0]} and {files[1]}"


def _text(name: str) -> Div:
    style = (HERE / "panel.css").read_text(encoding="utf-8")
    return Div(name=name, sizing_mode="stretch_width", margin=0, stylesheets=[style])
