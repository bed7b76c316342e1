"""The texts of the page as HTML: states, faults with their remedy, events, scores, timing of the loop."""

from __future__ import annotations

from collections import deque
from html import escape
from typing import Any

import numpy as np

from smadrive.control.loop import LATE_FRACTION
from smadrive.measurement import DisplacementFrom
from smadrive.safety.shutdown import off_text
from smadrive.stream.published_state import PublishedMode
from smadrive.stream.samples import COLUMN, Rows

TIMED_ROWS = 1200
SHOWN_EVENTS = 8
COOLING_SHOWN, SHIFT_SHOWN_C = 0.15, 2.0
"""Least deviation of the cooling factor from 1, and least shift of the transformation in K, that are shown.

Errors of the heat balance and of the model cause smaller deviations even without a disturbance.
"""

SENSOR_REPLACED = (
    "warning: the displacement sensor has failed, and the resistance of the wire replaces it; "
    "its readings are not shown, and the displacement is estimated"
)

_LATE = COLUMN["late_s"]


class LoopTiming:
    """Lateness of the last `TIMED_ROWS` ticks, and the number of missed ticks among all ticks that were added.

    A tick is missed if it starts later than `LATE_FRACTION` of the period after its deadline.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._late_s: deque[float] = deque(maxlen=TIMED_ROWS)
        self.missed = 0

    def add(self, rows: Rows) -> None:
        """Add the rows of new ticks."""
        late_s = rows[:, _LATE]
        self._late_s.extend(late_s.tolist())
        self.missed += int(np.sum(late_s > LATE_FRACTION * self._period_s))

    def __str__(self) -> str:
        """Return a text: the period, median and 99th percentile of the lateness, and the number of missed ticks."""
        if not self._late_s:
            return "no tick yet"
        median_ms, worst_ms = 1e3 * np.percentile(self._late_s, (50, 99))
        return f"{1e3 * self._period_s:.0f} ms · late {median_ms:.2f} ms, p99 {worst_ms:.2f} ms · {self.missed} missed"


def chips_html(status: dict[str, Any], timing: str, *, late: bool, controls: bool) -> str:
    """Return the header line of the tuning page as HTML: a row of chips, each with a name and a text.

    The chips are heater, active limits, model, full memory, displacement source, disturbances, loop, and control.
    `timing` is the text of the loop timing. If `late` is True, the text is marked as a warning. `controls` is True if
    this page has control.
    """
    limits = status["limited_by"]
    tuning = status["tuning"]
    certified = f"contracting, {tuning['invertible_percent']:.1f} % invertible"
    memory = status["turning_points"]
    return "".join(
        [
            _heater_chip(status),
            _chip("limited by", ", ".join(limits) or "nothing", "warn" if limits else "calm"),
            _chip("model", f"{tuning['change']} · {certified}", "warn" if tuning["caveats"] else "calm"),
            *([_dropped_chip(memory)] if memory and memory["dropped"] else []),
            *_source_chips(tuning["displacement_from"], status["displacement_in_force"]),
            *_disturbance_chips(status["cooling"], status["shift_c"]),
            _chip("loop", timing, "warn" if late else "calm"),
            _chip("this page", "controls" if controls else "watches", "on" if controls else "off"),
        ]
    )


def _heater_chip(status: dict[str, Any]) -> str:
    mode = PublishedMode(status["mode"])
    if status["unexpected_current"]:
        return _chip("heater", f"{mode}, but current flows", "bad")
    if mode is PublishedMode.UNCONFIRMED:
        return _chip("heater", mode, "bad")
    return _chip("heater", mode, "on" if mode.heats else "off")


def _source_chips(chosen: str, in_force: str | None) -> list[str]:
    """Return a list with the chip of the displacement source in force. The list is empty if no source is in force.

    No source is in force while the heater is off.
    """
    if in_force is None:
        return []
    if in_force == chosen:
        return [_chip("displacement from", in_force, "calm")]
    kind = "warn" if chosen == DisplacementFrom.SENSOR else "calm"
    return [_chip("displacement from", f"{in_force}, not {chosen}", kind)]


def _disturbance_chips(cooling: float | None, shift_c: float | None) -> list[str]:
    """Return the chips of the disturbances that the observer estimates, and that are large enough to be shown."""
    chips = []
    if cooling is not None and abs(cooling - 1.0) >= COOLING_SHOWN:
        chips.append(_chip("cooling", f"{cooling:.1f} × identified", "warn"))
    if shift_c is not None and abs(shift_c) >= SHIFT_SHOWN_C:
        chips.append(_chip("load", f"transformation {shift_c:+.0f} K".replace("-", "−"), "warn"))
    return chips


def _dropped_chip(memory: dict[str, Any]) -> str:
    return _chip("memory", f"full: {memory['dropped']} turning points of the smallest loops dropped", "warn")


def watch_chips_html(status: dict[str, Any], timing: str, *, late: bool) -> str:
    """Return the header line of the page of `smadrive watch` as HTML: heater, devices, timing of the measurements.

    `timing` is the text of the timing. If `late` is True, the text is marked as a warning.
    """
    devices = "; ".join(f"{name}: {identity}" for name, identity in status["devices"].items())
    return "".join(
        [
            _heater_chip(status),
            _chip("devices", devices, "calm"),
            _chip("measurements", timing, "warn" if late else "calm"),
        ]
    )


def watch_banner_html(status: dict[str, Any]) -> str:
    """Return the warnings of the page of `smadrive watch` as HTML; an empty text if there are none.

    The warnings are a current that flows although the heater is off, the latched faults of device and rig, and a fault
    of the thermocouple. A lost device ends the command.
    """
    lines = _device_lines(status, clear="run `smadrive off RIG --clear-faults`")
    if status["latched"]:
        lines.append(
            ("bad", f"latched: {status['latched']}; remove the cause, then run `smadrive off RIG --clear-faults`")
        )
    return _lines_html(lines)


def banner_html(status: dict[str, Any], note: str) -> str:
    """Return the banner of the tuning page as HTML, one line each; an empty text if there is nothing to show.

    The lines are a heater that is not confirmed off, the fault, a lost device, a current that flows although the heater
    is off, latched device faults, a thermocouple fault, caveats of the model, a replaced displacement sensor, drift of
    the wire, and `note`. `note` is a text about the last action of this page, for example the reason for a refusal.
    """
    lines = []
    if status["mode"] == PublishedMode.UNCONFIRMED:
        text = off_text(confirmed=False)
        lines.append(("bad", f"{text[0].upper()}{text[1:]}."))
    if status["fault"]:
        lines.append(("bad", status["fault"]))
    lines += _device_lines(status, clear="press Clear faults")
    lines.extend(("note", f"warning about the model in force: {caveat}") for caveat in status["tuning"]["caveats"])
    if status["displacement_in_force"] == DisplacementFrom.RESISTANCE != status["tuning"]["displacement_from"]:
        lines.append(("note", SENSOR_REPLACED))
    if status["wire_warning"]:
        lines.append(("note", f"warning: {status['wire_warning']}"))
    if note:
        lines.append(("note", note))
    return _lines_html(lines)


def _device_lines(status: dict[str, Any], clear: str) -> list[tuple[str, str]]:
    """Return lines about a lost device, an unexpected current, latched faults and missing readings.

    Each line has its CSS classes and its text.
    `clear` is the instruction for clearing latched faults.
    """
    lines = []
    if status["lost"]:
        lines.append(("bad lost", f"no answer: {status['lost']}"))
    if status["unexpected_current"]:
        lines.append(("bad", status["unexpected_current"]))
    if status["device_faults"]:
        latched = ", ".join(status["device_faults"])
        lines.append(("bad", f"latched on the device: {latched}; remove the cause, then {clear}"))
    if status["temperature_fault"]:
        lines.append(("bad", f"thermocouple: {status['temperature_fault']}"))
    if status["supply_fault"]:
        lines.append(("bad", f"current or voltage unknown: {status['supply_fault']}"))
    return lines


def _lines_html(lines: list[tuple[str, str]]) -> str:
    return "".join(f'<div class="line {kind}">{escape(text)}</div>' for kind, text in lines)


def events_html(events: list[tuple[float, str]]) -> str:
    """Return the table of the latest events as HTML. `events` are (time in s, text), the oldest first."""
    lines = [
        f"<tr><td>{time_s:.1f} s</td><td>{escape(text)}</td></tr>" for time_s, text in reversed(events[-SHOWN_EVENTS:])
    ]
    return f'<table class="events">{"".join(lines)}</table>'


def scores_html(comparison: dict[str, Any]) -> str:
    """Return slots A and B as HTML, each with its tuning and its score. The slot that drives the wire is marked."""
    cells = []
    for slot in ("A", "B"):
        mean_percent, cycles = comparison["scores"][slot]
        turns = f"{cycles} turn{'s' if cycles > 1 else ''}"
        score = f"{mean_percent:.2f} % RMS, {turns}" if cycles else "not scored"
        kept = comparison["slots"].get(slot)
        driving = " driving" if comparison["turn"] == slot else ""
        cells.append(f'<div class="slot{driving}"><b>{slot}</b> {escape(kept or "empty")}<br>{score}</div>')
    return f'<div class="slots">{"".join(cells)}</div>'


def _chip(name: str, text: str, kind: str) -> str:
    return f'<span class="chip {kind}"><i>{escape(name)}</i><b>{escape(text)}</b></span>'
