"""The large numbers of a page: temperature, displacement, current, and tracking error or voltage of the newest sample.

Each number has a state: `measured`, `estimated` or `commanded`. If a number has no value, the state says why:
`unknown`, `no setpoint` or `no sample`. A script of page.html writes the texts of the numbers into fixed fields, so the
browser need not compute a new layout.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import isfinite, nan
from typing import NamedTuple

from bokeh.core.properties import List, String
from bokeh.model import DataModel
from bokeh.models import CustomJS

from smadrive.stream.samples import COLUMN, Rows

OLD_S = 1.5
"""Numbers are hidden if no sample has arrived for this time, or for `OLD_PERIODS` periods if these are longer."""

OLD_PERIODS = 4.0

NONE = "—"

DIGITS = 4
"""Largest number of digits of a value, so that the value fits into its field."""


class LiveNumber(NamedTuple):
    """The texts of one number: the value, its state, and a note, which is empty or has two lines."""

    value: str
    state: str
    note: str = ""


class NumberTexts(DataModel):  # type: ignore[misc]  # bokeh has no type for it
    """Texts that browser and page process share: value, state and note of each number, in the order of the page."""

    texts = List(List(String))


class LiveNumbers:
    """Shows the numbers of the newest sample until it is too old. `model` is the root that the document needs.

    `numbers_of_row` returns the four numbers that the page shows for one row of samples.
    """

    def __init__(
        self,
        period_s: float,
        numbers_of_row: Callable[[Rows], tuple[LiveNumber, ...]],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._numbers_of_row = numbers_of_row
        self.model = NumberTexts(name="numbers", texts=[list(number) for number in _without("no sample")])
        self.on_load = CustomJS(args={"numbers": self.model}, code="showNumbers(numbers.texts)")
        self.model.js_on_change("texts", self.on_load)
        self._old_s = max(OLD_S, OLD_PERIODS * period_s)
        self._clock_s = clock_s
        self._newest_s = float("-inf")

    def update(self, rows: Rows) -> None:
        """Show the last of the new `rows`. If no row has arrived for too long (see OLD_S), show no value."""
        now_s = self._clock_s()
        if rows.size:
            self._newest_s = now_s
            self._show(self._numbers_of_row(rows[-1]))
        elif now_s - self._newest_s > self._old_s:
            self._show(_without("no sample"))

    def _show(self, numbers: tuple[LiveNumber, ...]) -> None:
        texts = [list(number) for number in numbers]
        if self.model.texts != texts:
            self.model.texts = texts


def measured_numbers(row: Rows) -> tuple[LiveNumber, ...]:
    """Return temperature, displacement, current and voltage of the row. The state of a missing value is `unknown`."""
    return (
        _measured(row, "temperature_c", 1),
        _measured(row, "displacement_mm", 2),
        _measured(row, "current_a", 3),
        _measured(row, "voltage_v", 2),
    )


def _measured(row: Rows, name: str, decimals: int) -> LiveNumber:
    value = float(row[COLUMN[name]])
    return LiveNumber(_text(value, decimals), "measured" if isfinite(value) else "unknown")


def tracking_numbers(row: Rows, stroke_mm: float) -> tuple[LiveNumber, ...]:
    """Return temperature, displacement, current and tracking error of the row, for a wire with the given stroke.

    A missing measurement of temperature or displacement is replaced by the estimate of the model, a missing
    measurement of the current by the commanded current.
    """
    values = {name: float(row[number]) for name, number in COLUMN.items()}
    setpoint_mm = values["setpoint_mm"]
    reached_mm = next((mm for mm in (values["displacement_mm"], values["estimated_mm"]) if isfinite(mm)), nan)
    displacement = _number(values, "displacement_mm", "estimated_mm", "estimated", 2)
    error_mm = setpoint_mm - reached_mm
    return (
        _number(values, "temperature_c", "estimated_c", "estimated", 1)._replace(
            note=_note("setpoint", values["setpoint_c"], 1, "°C")
        ),
        displacement._replace(note=_note("setpoint", setpoint_mm, 2, "mm")),
        _number(values, "current_a", "commanded_a", "commanded", 3)._replace(
            note=_note("commanded", values["commanded_a"], 3, "A")
        ),
        LiveNumber(
            _text(error_mm, 2, sign="+"),
            displacement.state if isfinite(error_mm) else "no setpoint",
            f"{_text(100.0 * error_mm / stroke_mm, 1, sign='+')} %\nof stroke" if isfinite(error_mm) else "",
        ),
    )


def _number(values: dict[str, float], measured: str, other: str, state: str, decimals: int) -> LiveNumber:
    if isfinite(values[measured]):
        return LiveNumber(_text(values[measured], decimals), "measured")
    return LiveNumber(_text(values[other], decimals), state if isfinite(values[other]) else "unknown")


def _note(name: str, value: float, decimals: int, unit: str) -> str:
    return f"{name}\n{_text(value, decimals)} {unit}" if isfinite(value) else ""


def _text(value: float, decimals: int, *, sign: str = "") -> str:
    """Return a value with a real minus sign, and with at most `DIGITS` digits. A rounded zero has no minus sign."""
    if not isfinite(value):
        return NONE
    decimals = max(min(decimals, DIGITS - len(f"{abs(value):.0f}")), 0)
    rounded = round(value, decimals) + 0.0
    return f"{rounded:{sign}.{decimals}f}".replace("-", "−")


def _without(state: str) -> tuple[LiveNumber, ...]:
    return (LiveNumber(NONE, state),) * 4
