"""The document of a page: its template, its roots and its texts."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.models import Div

from smadrive.tuning.page.view.live_numbers import LiveNumbers

HERE = Path(__file__).parent

FRAME_MS = 300
"""A page draws the content of the channel with this period."""


def fill(doc: Document, roots: Iterable[Any], numbers: LiveNumbers, rig: str, *, controls: bool) -> None:
    """Add the roots, the numbers and the template to a document. `rig` is the name of the rig, for the title.

    If `controls` is True, the document is the tuning page, otherwise the page of `smadrive watch`.
    """
    for root in (*roots, numbers.model):
        doc.add_root(root)
    doc.js_on_event("document_ready", numbers.on_load)
    doc.config.notify_connection_status = False  # the page itself shows the end of the run and a lost connection
    doc.title = f"smadrive · {rig}"
    doc.template = (HERE / "page.html").read_text(encoding="utf-8")
    doc.template_variables.update(rig=rig, controls=controls)


def text_block(name: str) -> Div:
    """Return an empty block of text, which the template places by its name."""
    style = (HERE / "panel.css").read_text(encoding="utf-8")
    return Div(name=name, sizing_mode="stretch_width", margin=0, stylesheets=[style])


def show_text(block: Div, html: str) -> None:
    """Show `html` if it has changed, because every assignment goes to the browser."""
    if block.text != html:
        block.text = html
