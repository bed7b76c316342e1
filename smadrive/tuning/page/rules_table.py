"""The table of the rules in force; the user edits its cells."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.models import ColumnDataSource, CustomJS, DataTable, NumberEditor, NumberFormatter, TableColumn

LAWS = ("a_heating", "b_heating", "a_cooling", "b_cooling")

STYLE = ".slick-cell, .slick-header-column { font-size: 11.5px; }"


class RulesTable:
    """The table of rules. When the user edits a rule, `edited` is called with the values of a SetRule."""

    def __init__(self, edited: Callable[..., None]) -> None:
        self._edited = edited
        self._source = ColumnDataSource({name: [] for name in ("centre", *LAWS)})
        self._shown: list[list[float]] = []
        self._source.on_change("data", self._changed)
        self.widget = self._table()

    def show(self, centres: list[float], laws: dict[str, list[float]]) -> None:
        """Show the rules in force: `centres` of the fuzzy sets in °C, and `laws` with one number per set and law."""
        self._shown = [laws[name] for name in LAWS]
        self._source.data = {"centre": centres, **{name: list(laws[name]) for name in LAWS}}

    def enable(self, on: bool) -> None:
        """Enable editing if `on`, otherwise disable it."""
        self.widget.editable = on

    def _changed(self, _attribute: str, _old: Any, data: dict[str, Any]) -> None:
        for law, shown in zip(LAWS, self._shown, strict=True):
            for index, (value, before) in enumerate(zip(data[law], shown, strict=True)):
                if value != before:
                    direction = 1 if law.endswith("heating") else -1
                    branch = "heating" if direction > 0 else "cooling"
                    a, b = (float(data[f"{symbol}_{branch}"][index]) for symbol in "ab")
                    self._edited(index=index, direction=direction, a=a, b=b)
                    return

    def _table(self) -> DataTable:
        plain = NumberFormatter(format="0.0", text_align="right")
        fine = NumberFormatter(format="0.0000", text_align="right")
        columns = [TableColumn(field="centre", title="centre / °C", formatter=plain, width=60)]
        for law in LAWS:
            title = law.replace("_", " ")
            columns.append(TableColumn(field=law, title=title, formatter=fine, editor=NumberEditor(), width=80))
        table = DataTable(
            source=self._source,
            columns=columns,
            editable=True,
            index_position=None,
            sortable=False,
            reorderable=False,
            row_height=22,
            name="rules",
            sizing_mode="stretch_both",
            autosize_mode="force_fit",
            stylesheets=[STYLE],
        )
        # A table redraws its rows when its view changes, but bokeh changes the view only with the number of rows.
        self._source.js_on_change("data", CustomJS(args={"view": table.view}, code="view.change.emit()"))
        return table
