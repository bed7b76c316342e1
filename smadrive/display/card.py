"""A card: the facts of an object as a table, with an optional plot beside it. Works on light and dark pages."""

from __future__ import annotations

import html
from collections.abc import Iterable

from smadrive.display.colours import CARD_WARNING

Facts = Iterable[tuple[str, str]]

FONT = "font-family:system-ui,sans-serif;font-size:13px"
BOX = "display:flex;flex-wrap:wrap;gap:0 2em;align-items:center"
CELL = "text-align:left;padding:1px 1em 1px 0;border:0;background:none;color:inherit"


def card(title: str, facts: Facts, plot: str = "", warnings: Iterable[str] = ()) -> str:
    """Return the HTML of a card; `plot` is HTML, everything else is text."""
    rows = "".join(
        f"<tr style='background:none'><td style='{CELL};opacity:.7'>{html.escape(name)}</td>"
        f"<td style='{CELL};font-variant-numeric:tabular-nums'>{html.escape(value)}</td></tr>"
        for name, value in facts
    )
    notes = "".join(f"<div style='color:{CARD_WARNING}'>warning: {html.escape(text)}</div>" for text in warnings)
    table = f"<table style='border:0;margin:0;color:inherit;font:inherit'>{rows}</table>" if rows else ""
    return f"<div style='{FONT}'><b>{html.escape(title)}</b><div style='{BOX}'>{table}{plot}</div>{notes}</div>"
