"""The widgets of the page: knobs, buttons, fields. A widget only passes the action of the user to the page."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import nan
from typing import Any, get_args

from bokeh.models import Button, Select, Spinner, TextInput

from smadrive.stream.published_state import PublishedMode
from smadrive.tuning.link.requests import FeedbackKey, ShapeKey
from smadrive.tuning.page.button_events import ButtonEvents
from smadrive.tuning.page.knob import COMPACT, Knob
from smadrive.tuning.page.rules_table import RulesTable
from smadrive.tuning.page.source_choice import SourceChoice

Act = Callable[..., None]
"""A function that does an action of the user: `act(name, **values)`."""

ACTS = {
    **dict.fromkeys(get_args(ShapeKey), "shape"),
    **dict.fromkeys(get_args(FeedbackKey), "feedback"),
    "source": "source",
    "rules": "rule",
    "arm": "arm",
    "disarm": "off",
    "clear": "clear",
    "start": "track",
    "hold": "hold",
    "undo": "undo",
    "redo": "redo",
    "keep_a": "keep",
    "keep_b": "keep",
    "use_a": "recall",
    "use_b": "recall",
    "compare": "compare",
    "adapt": "adapt",
    "fit": "model",
    "save": "note",
}
"""The act of the request that each widget sends. A widget is disabled while the session refuses this act."""


class Controls:
    """All widgets. The template page.html places them by their names.

    Every action of the user calls `act`, which checks that this client controls the session. `references` are the names
    of the references that the user can start.
    """

    def __init__(self, act: Act, references: list[str]) -> None:
        self._act = act
        self.knobs = {
            "mu_heating": Knob("mu_heating", "μ heating / °C", 0.05, self._shape),
            "mu_cooling": Knob("mu_cooling", "μ cooling / °C", 0.05, self._shape),
            "sigma_heating": Knob("sigma_heating", "σ heating / K", 0.02, self._shape),
            "sigma_cooling": Knob("sigma_cooling", "σ cooling / K", 0.02, self._shape),
            "scale": Knob("scale", "scale / mm", 0.01, self._shape),
            "closed_loop_s": Knob("closed_loop_s", "feedback: closed loop / s", 0.01, self._feedback),
            "integral_s": Knob("integral_s", "feedback: integral / s", 0.1, self._feedback),
            "feedforward_share": Knob("feedforward_share", "feedforward share", 0.01, self._feedback),
        }
        self.events = ButtonEvents(name="button_events")
        self.buttons = {
            "arm": self._driving_button("arm", "Arm", "primary", lambda offs: act("arm", offs=offs)),
            "disarm": self._button("disarm", "Disarm", "default", partial(act, "off")),
            "clear": self._button("clear", "Clear faults", "default", partial(act, "clear")),
            "start": self._driving_button("start", "Start", "primary", self._start),
            "hold": self._driving_button("hold", "Hold", "default", lambda offs: act("hold", offs=offs)),
            "undo": self._button("undo", "Undo", "default", partial(act, "undo")),
            "redo": self._button("redo", "Redo", "default", partial(act, "redo")),
            "keep_a": self._button("keep_a", "Keep A", "default", partial(act, "keep", slot="A")),
            "keep_b": self._button("keep_b", "Keep B", "default", partial(act, "keep", slot="B")),
            "use_a": self._button("use_a", "Use A", "default", partial(act, "recall", slot="A")),
            "use_b": self._button("use_b", "Use B", "default", partial(act, "recall", slot="B")),
            "compare": self._driving_button("compare", "Compare", "default", self._compare),
            "adapt": self._button("adapt", "Adapt", "default", lambda: act("adapt", on=not self._is_adapting)),
            "fit": self._button("fit", "Fit", "default", lambda: act("fit", seconds=_number(self._fit_s.value))),
            "save": self._button("save", "Save", "default", lambda: act("save", name=str(self._name.value))),
        }
        self._reference = Select(value=references[0] if references else "", options=references, name="reference")
        self._reference.sizing_mode = "stretch_width"
        self._spec = TextInput(placeholder="or sine:low_mm=2,high_mm=9,period_s=56", name="spec")
        self._spec.sizing_mode = "stretch_width"
        self._fit_s = Spinner(value=120.0, low=10.0, high=1500.0, step=10.0, width=92, name="fit_s")
        self._name = TextInput(placeholder="name of the new files", name="save_name", sizing_mode="stretch_width")
        for widget in (self._reference, self._spec, self._fit_s, self._name):
            widget.update(margin=(2, 3, 2, 3), stylesheets=[COMPACT])
        self._is_comparing = self._is_adapting = False
        self.rules = RulesTable(partial(act, "rule"))
        self.source = SourceChoice(lambda source: act("source", displacement_from=source))

    @property
    def roots(self) -> list[Any]:
        """All widgets that the template places."""
        knobs = [knob.row for knob in self.knobs.values()]
        fields = self._reference, self._spec, self._fit_s, self._name
        return [*knobs, *self.buttons.values(), *fields, self.rules.widget, self.source.widget]

    def enable(self, on: bool, *, status: dict[str, Any]) -> None:
        """Enable the widgets that this client can use in the present state, and disable the others.

        `on` is True if this client controls; `status` is the published status. It has the acts that the session refuses
        in its mode. The other conditions are here: an empty slot, nothing to undo, a heater that is off or unconfirmed.
        """
        mode, slots = PublishedMode(status["mode"]), status["comparison"]["slots"]
        possible = {
            "arm": mode is not PublishedMode.UNCONFIRMED,
            "disarm": mode.heats,
            "undo": status["undo"] is not None,
            "redo": status["redo"] is not None,
            "use_a": "A" in slots,
            "use_b": "B" in slots,
            "compare": len(slots) == 2,
        }
        enabled = {
            name: on and act not in status["refused_acts"] and possible.get(name, True) for name, act in ACTS.items()
        }
        for name, knob in self.knobs.items():
            knob.enable(enabled[name])
        for name, button in self.buttons.items():
            _set(button, disabled=not enabled[name])
        self.rules.enable(enabled["rules"])
        self.source.enable(enabled["source"])
        self._is_comparing, self._is_adapting = status["comparison"]["on"], status["adapts"]
        _set(self.buttons["compare"], label="Stop comparing" if self._is_comparing else "Compare A / B")
        _set(self.buttons["adapt"], label="Stop adapting" if self._is_adapting else "Adapt online")
        _set(self.buttons["undo"], label=f"Undo {status['undo']}" if status["undo"] else "Undo")
        _set(self.buttons["redo"], label=f"Redo {status['redo']}" if status["redo"] else "Redo")

    def _button(self, name: str, label: str, kind: str, pressed: Callable[[], None]) -> Button:
        button = _button(name, label, kind)
        button.on_click(lambda _event: pressed())
        return button

    def _driving_button(self, name: str, label: str, kind: str, pressed: Callable[[int], None]) -> Button:
        button = _button(name, label, kind)
        self.events.on(button, pressed)
        return button

    def _shape(self, key: str, value: float) -> None:
        self._act("shape", key=key, value=value)

    def _feedback(self, key: str, value: float) -> None:
        self._act("feedback", key=key, value=value)

    def _start(self, offs: int) -> None:
        self._act("track", offs=offs, reference=str(self._spec.value).strip() or str(self._reference.value))

    def _compare(self, offs: int) -> None:
        self._act("compare", offs=offs, on=not self._is_comparing)


def _number(value: float | None) -> float:
    """Return the number in a field; NaN if the user has emptied the field."""
    return nan if value is None else float(value)


def _button(name: str, label: str, kind: str) -> Button:
    button = Button(label=label, button_type=kind, name=name, sizing_mode="stretch_width")
    button.update(margin=(2, 3, 2, 3), stylesheets=[COMPACT])
    return button


def _set(widget: Any, **values: Any) -> None:
    """Set the values that differ. Values that are equal are skipped, because every assignment goes to the browser."""
    for name, value in values.items():
        if getattr(widget, name) != value:
            setattr(widget, name, value)
