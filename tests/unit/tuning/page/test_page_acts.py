"""Every action is done on the page in control, and refused on all other pages."""

import json
import secrets
from functools import partial
from types import SimpleNamespace

import pytest
from bokeh.document import Document
from bokeh.events import ButtonClick
from bokeh.models import Button, ColumnDataSource, RadioButtonGroup, Slider, Spinner
from bokeh.server.callbacks import NextTickCallback

from smadrive.rig.config import rig_file
from smadrive.tuning.page.button_events import ButtonEvents
from smadrive.tuning.page.client_registry import WATCHES, ClientRegistry
from smadrive.tuning.page.fit import Fitter
from smadrive.tuning.page.page import STATE_FRAMES, Page
from smadrive.tuning.page.view.sample_history import SampleHistory

TOKEN = secrets.token_urlsafe(8)


def edit_rule(source):
    """Change the data as the table of rules does when the user edits its first cell."""
    source.data = {**source.data, "a_heating": [-0.01, *source.data["a_heating"][1:]]}


def turn(number):
    number.value += 0.01


def press_next(buttons):
    buttons.active = (buttons.active + 1) % len(buttons.labels)


CHANGES = {
    (Slider, "value"): turn,
    (Spinner, "value"): turn,
    (ColumnDataSource, "data"): edit_rule,
    (RadioButtonGroup, "active"): press_next,
}
"""Functions that change a value of a widget, as a user does. A new kind of widget needs a line here."""


LOOKS = {"pause", "back", "forward", "closer", "wider", "whole"}
"""The buttons that only change what this page shows. Every page may press them."""


class OpenPage:
    """A page of an idle session, built as the page process builds it."""

    def __init__(self, rig, folder, token):
        rig.run(until_s=1.0)
        self.rig, self.fitter = rig, Fitter()
        clients = ClientRegistry(rig.page, TOKEN)
        clients.read()
        self._doc = Document()
        self._context = SimpleNamespace(id="client", request=SimpleNamespace(arguments={"token": [token.encode()]}))
        self._doc._session_context = lambda: self._context
        self._page = Page(self._doc, clients, self.fitter, SampleHistory(rig.page), folder, rig_file("simulated"))
        self._doc.get_model_by_name("save_name").value = "stolen"

    def acts(self):
        """Return all actions of a user, by the names of widget and event."""
        events = next(model for model in self._doc.models if isinstance(model, ButtonEvents))
        for model in sorted(self._doc.models, key=lambda model: model.id):
            for event in model._event_callbacks:
                yield (model.name, event), partial(model._trigger_event, {"button_click": ButtonClick}[event](model))
            for attribute in model._callbacks:
                if model is not events:
                    yield (model.id, attribute), partial(CHANGES[type(model), attribute], model)
            if isinstance(model, Button) and not model._event_callbacks:
                yield (
                    (model.name, "click"),
                    partial(setattr, events, "latest", (model.name, 0, int(model.id[1:]))),
                )

    def note_after(self, act):
        """Do an action, and return the note in the banner of the page.

        Like the server, this method runs what the action has scheduled for the next tick of the document.
        """
        self._page._note = ""
        act()
        for scheduled in self._doc.session_callbacks:
            if isinstance(scheduled, NextTickCallback):
                scheduled.callback()
        for _ in range(STATE_FRAMES):
            self._page._draw()
        return self._doc.get_model_by_name("banner").text

    def empty(self, name):
        """Empty a field for a number, as a user does who deletes its text."""
        self._doc.get_model_by_name(name).value = None

    @property
    def buttons(self):
        return {model.name for model in self._doc.models if isinstance(model, Button)}


@pytest.fixture(params=["wrong", TOKEN], ids=["watches", "controls"])
def opened(request, ruled_rig, tmp_path):
    page = OpenPage(ruled_rig, tmp_path, request.param)
    yield page, request.param == TOKEN
    page.fitter.close()


@pytest.mark.exhaustive
def test_every_action_of_a_page_is_refused_unless_it_controls(opened, tmp_path):
    page, controls = opened
    acts = {name: act for name, act in page.acts() if name[0] not in LOOKS}
    assert page.buttons - LOOKS <= {name for name, _ in acts}
    refused = {name for name, act in acts.items() if WATCHES in page.note_after(act)}
    assert refused == (set() if controls else set(acts))
    assert bool(list(page.rig.driver_end.received(100))) == controls
    assert bool(list(tmp_path.iterdir())) == controls


@pytest.mark.exhaustive
def test_fit_to_an_empty_number_of_seconds_is_refused(opened):
    page, controls = opened
    page.empty("fit_s")
    note = page.note_after(dict(page.acts())["fit", "button_click"])
    sent = [json.loads(message)["act"] for message in page.rig.driver_end.received(100)]
    assert (WATCHES in note, sent) == ((False, ["note"]) if controls else (True, []))


@pytest.mark.exhaustive
def test_looking_back_sends_no_request_and_is_refused_to_no_page(opened, tmp_path):
    page, _ = opened
    looks = {name: act for name, act in page.acts() if name[0] in LOOKS}
    assert {name for name, _ in looks} == LOOKS
    assert not {name for name, act in looks.items() if WATCHES in page.note_after(act)}
    assert not list(page.rig.driver_end.received(100))
    assert not list(tmp_path.iterdir())
