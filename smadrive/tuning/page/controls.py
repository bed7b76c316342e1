"""What can be turned and pressed on the page. Widgets say what is wanted; only the control process decides.

A slider and a field show the value in force. While the user turns one, what the loop says of it is not shown for
`HANDS_OFF_S`, so that it does not jump back under the hand; a refusal brings the value in force back at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from bokeh.models import (
    Button,
    ColumnDataSource,
    CustomJS,
    DataTable,
    NumberEditor,
    NumberFormatter,
    Row,
    Select,
    Slider,
    Spinner,
    TableColumn,
    TextInput,
)

from smadrive.tuning.page.button_events import ButtonEvents

HANDS_OFF_S = 1.0

ACCENT = "#0b8f87"
"""The colour of what is on, measured, or meant to be pressed."""

COMPACT = f"""
:host {{ font-size: 12px; }} .bk-input, .bk-btn {{ min-height: 26px; padding: 2px 8px; }}
.bk-btn-primary, .bk-btn-primary:is(:hover, :active, :focus) {{ background: {ACCENT}; border-color: {ACCENT}; }}
.noUi-target:not([disabled]) .noUi-connect {{ background: {ACCENT}; }}
"""
"""The last line: bokeh gives a slider its `bar_color` only if it is enabled when it is drawn for the first time."""

LAWS = ("a_heating", "b_heating", "a_cooling", "b_cooling")

Act = Callable[..., None]
"""Do something: `act(name, **values)`."""


class Knob:
    """One number with a slider for the feel and a field for the figure."""

    def __init__(self, name: str, title: str, step: float, turned: Callable[[str, float], None]) -> None:
        self._name = name
        self._turned = turned
        self._turned_s = float("-inf")
        self._is_showing = False
        self._slider = Slider(
            title=title,
            start=0.0,
            end=1.0,
            value=0.5,
            step=step,
            show_value=False,
            bar_color=ACCENT,
            sizing_mode="stretch_width",
        )
        self._field = Spinner(value=0.5, step=step, width=84, format="0.[000]", align="end")
        for widget in (self._slider, self._field):
            widget.update(margin=(1, 4, 1, 4), stylesheets=[COMPACT])
        self._slider.on_change("value", self._changed)
        self._field.on_change("value", self._changed)
        self.row = Row(self._slider, self._field, sizing_mode="stretch_width", name=name)

    def bound(self, low: float, high: float) -> None:
        """Where the slider ends; a field goes further, to what the control process allows."""
        self._slider.update(start=low, end=high)

    def show(self, value: float, *, now: bool = False) -> None:
        """Show the value in force, unless a hand is on it."""
        if not now and time.monotonic() - self._turned_s < HANDS_OFF_S:
            return
        if value == self._field.value:
            return
        self._is_showing = True
        self._field.value = value
        self._slider.value = min(max(value, self._slider.start), self._slider.end)
        self._is_showing = False

    def enable(self, on: bool) -> None:
        """Whether it can be turned."""
        self._slider.disabled = self._field.disabled = not on

    def _changed(self, _attribute: str, _old: float, value: float | None) -> None:
        if self._is_showing or value is None:
            return
        self._turned_s = time.monotonic()
        self._is_showing = True
        self._field.value = value
        self._slider.value = min(max(value, self._slider.start), self._slider.end)
        self._is_showing = False
        self._turned(self._name, value)


class Controls:
    """All widgets, by the name under which the page's template places them.

    Whatever a user does comes to `act`, which decides whether this user may do it.
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
        self.presses = ButtonEvents(name="presses")
        self.buttons = {
            "arm": self._driving("arm", "Arm", "primary", lambda offs: act("arm", offs=offs)),
            "disarm": self._button("disarm", "Disarm", "default", partial(act, "off")),
            "clear": self._button("clear", "Clear faults", "default", partial(act, "clear")),
            "start": self._driving("start", "Start", "primary", self._start),
            "hold": self._driving("hold", "Hold", "default", lambda offs: act("hold", offs=offs)),
            "undo": self._button("undo", "Undo", "default", partial(act, "undo")),
            "redo": self._button("redo", "Redo", "default", partial(act, "redo")),
            "keep_a": self._button("keep_a", "Keep A", "default", partial(act, "keep", slot="A")),
            "keep_b": self._button("keep_b", "Keep B", "default", partial(act, "keep", slot="B")),
            "use_a": self._button("use_a", "Use A", "default", partial(act, "recall", slot="A")),
            "use_b": self._button("use_b", "Use B", "default", partial(act, "recall", slot="B")),
            "compare": self._driving("compare", "Compare", "default", self._compare),
            "adapt": self._button("adapt", "Adapt", "default", lambda: act("adapt", on=not self._is_adapting)),
            "fit": self._button("fit", "Fit", "default", lambda: act("fit", seconds=float(self._fit_s.value))),
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
        self._rules = ColumnDataSource({name: [] for name in ("centre", *LAWS)})
        self._shown_rules: list[list[float]] = []
        self._rules.on_change("data", self._rule_edited)
        self.table = self._rule_table()

    @property
    def roots(self) -> list[Any]:
        """Everything that the template places."""
        knobs = [knob.row for knob in self.knobs.values()]
        return [*knobs, *self.buttons.values(), self._reference, self._spec, self._fit_s, self._name, self.table]

    def enable(self, on: bool, *, status: dict[str, Any]) -> None:
        """What can be done now by this client."""
        mode, comparison = status["mode"], status["comparison"]
        heats, compares = mode in {"holding", "tracking"}, comparison["on"]
        self._is_comparing = compares
        for knob in self.knobs.values():
            knob.enable(on and not compares)
        allowed = {
            "arm": mode == "off",
            "disarm": heats,
            "clear": not heats,
            "start": heats and not compares,
            "hold": heats and not compares,
            "undo": status["undo"] is not None and not compares,
            "redo": status["redo"] is not None and not compares,
            "use_a": "A" in comparison["slots"] and not compares,
            "use_b": "B" in comparison["slots"] and not compares,
            "compare": compares or (mode == "tracking" and len(comparison["slots"]) == 2),
        }
        for name, button in self.buttons.items():
            _set(button, disabled=not (on and allowed.get(name, True)))
        _set(self.buttons["compare"], label="Stop comparing" if compares else "Compare A / B")
        self._is_adapting = status["adapts"]
        _set(self.buttons["adapt"], label="Stop adapting" if self._is_adapting else "Adapt online")
        _set(self.buttons["undo"], label=f"Undo {status['undo']}" if status["undo"] else "Undo")
        _set(self.buttons["redo"], label=f"Redo {status['redo']}" if status["redo"] else "Redo")
        self.table.editable = on and not compares

    def show_rules(self, centres: list[float], laws: dict[str, list[float]]) -> None:
        """The consequents in force."""
        self._shown_rules = [laws[name] for name in LAWS]
        self._rules.data = {"centre": centres, **{name: list(laws[name]) for name in LAWS}}

    def _button(self, name: str, label: str, kind: str, pressed: Callable[[], None]) -> Button:
        button = _button(name, label, kind)
        button.on_click(lambda _event: pressed())
        return button

    def _driving(self, name: str, label: str, kind: str, pressed: Callable[[int], None]) -> Button:
        button = _button(name, label, kind)
        self.presses.on(button, pressed)
        return button

    def _shape(self, key: str, value: float) -> None:
        self._act("shape", key=key, value=value)

    def _feedback(self, key: str, value: float) -> None:
        self._act("feedback", key=key, value=value)

    def _start(self, offs: int) -> None:
        self._act("track", offs=offs, reference=str(self._spec.value).strip() or str(self._reference.value))

    def _compare(self, offs: int) -> None:
        self._act("compare", offs=offs, on=not self._is_comparing)

    def _rule_edited(self, _attribute: str, _old: Any, data: dict[str, Any]) -> None:
        for law, shown in zip(LAWS, self._shown_rules, strict=True):
            for index, (value, before) in enumerate(zip(data[law], shown, strict=True)):
                if value != before:
                    direction = 1 if law.endswith("heating") else -1
                    branch = "heating" if direction > 0 else "cooling"
                    a, b = (float(data[f"{symbol}_{branch}"][index]) for symbol in "ab")
                    self._act("rule", index=index, direction=direction, a=a, b=b)
                    return

    def _rule_table(self) -> DataTable:
        plain = NumberFormatter(format="0.0", text_align="right")
        fine = NumberFormatter(format="0.0000", text_align="right")
        columns = [TableColumn(field="centre", title="about / °C", formatter=plain, width=60)]
        for law in LAWS:
            title = law.replace("_", " ")
            columns.append(TableColumn(field=law, title=title, formatter=fine, editor=NumberEditor(), width=80))
        table = DataTable(
            source=self._rules,
            columns=columns,
            editable=True,
            index_position=None,
            sortable=False,
            reorderable=False,
            row_height=22,
            name="rules",
            sizing_mode="stretch_both",
            autosize_mode="force_fit",
            stylesheets=[".slick-cell, .slick-header-column { font-size: 11.5px; }"],
        )
        # A table draws its rows anew when its view changes, and that changes with the number of rows alone: it is told.
        self._rules.js_on_change("data", CustomJS(args={"view": table.view}, code="view.change.emit()"))
        return table


def _button(name: str, label: str, kind: str) -> Button:
    button = Button(label=label, button_type=kind, name=name, sizing_mode="stretch_width")
    button.update(margin=(2, 3, 2, 3), stylesheets=[COMPACT])
    return button


def _set(widget: Any, **values: Any) -> None:
    """Set what differs: every assignment would be sent to the browser."""
    for name, value in values.items():
        if getattr(widget, name) != value:
            setattr(widget, name, value)
