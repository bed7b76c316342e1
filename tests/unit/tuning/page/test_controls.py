"""A widget of the page is enabled if and only if the session accepts its request."""

from functools import partial

import pytest
from bokeh.events import ButtonClick

from smadrive.tuning.page.controls import ACTS, Controls
from smadrive.tuning.page.rules_table import LAWS
from smadrive.tuning.session.modes import Mode, refused_acts

FINISHED_BY_THE_PAGE = {"fit": "model", "save": "note"}
"""The requests that the page sends after it has fitted a model or saved files."""


def enabled(status):
    """Return the names of the enabled buttons of a page that controls the session."""
    controls = Controls(lambda *_, **__: None, status["references"])
    controls.enable(True, status=status)
    return {name for name, button in controls.buttons.items() if not button.disabled}


def test_comparison_disables_every_button_whose_request_is_refused(rig):
    rig.at(1.0, "keep", slot="A")
    rig.at(1.1, "feedback", key="closed_loop_s", value=0.3)
    rig.at(1.5, "keep", slot="B")
    rig.at(2.0, "arm")
    rig.at(3.0, "track", reference="sine")
    rig.at(4.0, "compare", on=True)
    refused = [
        rig.at(5.0, "keep", slot="A"),
        rig.at(5.0, "keep", slot="B"),
        rig.at(5.0, "adapt", on=True),
        rig.at(5.1, "model", text=rig.properties.identified(rig.model).text(), source="fit to the last 60 s"),
    ]
    rig.run(until_s=6.0)
    assert rig.status["comparison"]["on"]
    assert all("being compared" in rig.answers[number] for number in refused)
    assert enabled(rig.status) == {"disarm", "compare", "save"}


@pytest.mark.parametrize(
    ("mode", "published", "expected"),
    [
        (Mode.IDLE, "off", {"arm", "clear"}),
        (Mode.IDLE, "off, unconfirmed", {"clear"}),
        (Mode.TRIPPED, "off", {"arm", "clear"}),
        (Mode.ARMING, "off", {"clear"}),
        (Mode.HOLDING, "holding", {"disarm", "start", "hold"}),
        (Mode.TRACKING, "tracking", {"disarm", "start", "hold"}),
        (Mode.COMPARING, "tracking", {"disarm"}),
    ],
)
def test_buttons_of_the_run_follow_the_mode(rig, mode, published, expected):
    rig.run(until_s=0.2)
    status = {**rig.status, "mode": published, "refused_acts": list(refused_acts(mode))}
    assert enabled(status) & {"arm", "disarm", "clear", "start", "hold"} == expected


def test_empty_slot_and_empty_history_disable_their_buttons(rig):
    rig.at(1.0, "keep", slot="A")
    rig.run(until_s=1.2)
    assert {"use_a", "use_b", "compare", "undo", "redo"} & enabled(rig.status) == {"use_a"}


def click(controls, button):
    """Click a button of either kind: with an event of the button itself, and with a button event."""
    button._trigger_event(ButtonClick(button))
    controls.events.latest = (button.name, 0, controls.events.latest[2] + 1)


def test_every_widget_sends_its_act():
    sent = []
    controls = Controls(lambda act, **_: sent.append(act), ["sine"])
    controls.rules.show([50.0], {law: [0.0] for law in LAWS})
    cells = controls.rules.widget.source
    uses = {name: partial(click, controls, button) for name, button in controls.buttons.items()}
    uses |= {name: partial(setattr, knob._field, "value", 0.6) for name, knob in controls.knobs.items()}
    uses["source"] = partial(setattr, controls.source.widget, "active", 1)
    uses["rules"] = partial(setattr, cells, "data", {**cells.data, "a_heating": [-0.01]})
    for use in uses.values():
        use()
    acts = (FINISHED_BY_THE_PAGE.get(act, act) for act in sent)
    assert dict(zip(uses, acts, strict=True)) == ACTS
