"""Writes one self-contained HTML page: metrics, plots, tables. The page loads nothing from the network.

A page is a sequence of parts, each of which renders its own HTML. Plots are vector drawings.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import matplotlib as mpl
from matplotlib.figure import Figure

from smadrive.display import colours
from smadrive.files.atomic import replacing
from smadrive.runs.plot_style import STYLE as PLOT_STYLE

PALETTE = f"""
:root {{
  --text: {colours.TEXT}; --soft-text: {colours.SOFT_TEXT}; --caption: {colours.CAPTION}; --link: {colours.LINK};
  --rule: {colours.RULE}; --panel: {colours.PANEL};
  --good: {colours.GOOD}; --warning: {colours.WARNING}; --bad: {colours.BAD};
  --good-shade: {colours.GOOD_SHADE}; --warning-shade: {colours.WARNING_SHADE}; --bad-shade: {colours.BAD_SHADE};
}}
"""

STYLE = """
:root { color: var(--text); background: #fff; font: 16px/1.55 system-ui, "Segoe UI", Roboto, sans-serif; }
body { max-width: 62rem; margin: 0 auto; padding: 2.5rem 1.25rem 4rem; }
h1 { font-size: 1.75rem; line-height: 1.25; margin: 0 0 .4rem; } .lead { color: var(--soft-text); margin: 0 0 1.5rem; }
h2 { font-size: 1.15rem; margin: 2.6rem 0 .6rem; padding-bottom: .3rem; border-bottom: 1px solid var(--rule); }
.banner { border-left: 5px solid; border-radius: .3rem; padding: .6rem 1rem; margin: 1rem 0; }
.good { background: var(--good-shade); border-color: var(--good); }
.bad { background: var(--bad-shade); border-color: var(--bad); }
.warning { background: var(--warning-shade); border-color: var(--warning); }
.tiles { display: grid; grid-template-columns: repeat(2, 1fr); gap: .75rem; margin: 1.25rem 0; }
@media (min-width: 40rem) { .tiles { grid-template-columns: repeat(var(--columns), 1fr); } }
.tile { background: var(--panel); border-radius: .5rem; padding: .7rem .9rem; }
.tile b { display: block; font-size: 1.35rem; line-height: 1.3; white-space: nowrap; }
.tile span { color: var(--caption); font-size: .85rem; }
figure { margin: .8rem 0; } img { width: 100%; height: auto; }
figcaption, footer { color: var(--caption); font-size: .9rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; } td, th { text-align: right; }
th, td { padding: .3rem 1rem .3rem 0; border-bottom: 1px solid var(--rule); vertical-align: top; }
th { color: var(--soft-text); font-weight: 600; } th:first-child, td:first-child { text-align: left; }
table.text td, table.text th { text-align: left; } table.text td:last-child { overflow-wrap: anywhere; }
table.text td:first-child { white-space: nowrap; }
details { margin: .6rem 0; } summary { cursor: pointer; color: var(--link); }
pre { white-space: pre-wrap; font-size: .8rem; background: var(--panel); padding: 1rem; border-radius: .5rem; }
@media print { body { padding: 0; } figure, .tile { break-inside: avoid; } }
"""


class PagePart(Protocol):
    """One part of a page."""

    def html(self) -> str:
        """Return the HTML of the part."""
        ...


@dataclass(frozen=True)
class Banner:
    """A coloured line that says how the run ended, or shows a warning. `level` selects the colour."""

    level: Literal["good", "warning", "bad"]
    text: str

    def html(self) -> str:
        """Return the HTML of the part."""
        return f"<p class='banner {self.level}'>{html.escape(self.text)}</p>"


@dataclass(frozen=True)
class Tiles:
    """The main metrics in large type. Each of `metrics` is a pair of texts: the value with its unit, and the name."""

    metrics: Sequence[tuple[str, str]]

    def html(self) -> str:
        """Return the HTML of the part."""
        tiles = (f"<div class=tile><b>{html.escape(v)}</b><span>{html.escape(n)}</span></div>" for v, n in self.metrics)
        columns = -(-len(self.metrics) // 2)
        return f"<div class=tiles style='--columns: {columns}'>{''.join(tiles)}</div>"


@dataclass(frozen=True)
class Grid:
    """A table. Cells after the first column are aligned to the right as numbers, or to the left if `texts` is True.

    If `folded` is True, the reader opens the table by a click on its title.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""
    texts: bool = False
    folded: bool = False

    def html(self) -> str:
        """Return the HTML of the part."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in self.rows)
        kind = " class=text" if self.texts else ""
        return _titled(
            self.title, f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>", self.folded
        )


@dataclass(frozen=True)
class Plot:
    """A figure with a title above it and an explanation (`caption`) below it."""

    title: str
    figure: Figure
    caption: str

    def html(self) -> str:
        """Return the HTML of the part."""
        buffer = io.BytesIO()
        with mpl.rc_context(PLOT_STYLE):
            self.figure.savefig(buffer, format="svg", dpi=150, metadata={"Date": None})
        drawing = base64.b64encode(buffer.getvalue()).decode("ascii")
        image = f"<img alt='{html.escape(self.title)}' src='data:image/svg+xml;base64,{drawing}'>"
        return _titled(self.title, f"<figure>{image}<figcaption>{html.escape(self.caption)}</figcaption></figure>")


@dataclass(frozen=True)
class Listing:
    """A verbatim text. The reader opens it by a click on its title."""

    title: str
    text: str

    def html(self) -> str:
        """Return the HTML of the part."""
        return _titled(self.title, f"<pre>{html.escape(self.text)}</pre>", folded=True)


@dataclass(frozen=True)
class Notes:
    """Sentences in small print."""

    lines: Sequence[str]

    def html(self) -> str:
        """Return the HTML of the part."""
        return "<footer>" + "".join(f"<p>{html.escape(line)}</p>" for line in self.lines) + "</footer>"


def write_report(path: Path, title: str, lead: str, parts: Sequence[PagePart]) -> None:
    """Write the page of `parts` to `path`, completely or not at all; `lead` is the line below the title.

    DataError when `path` cannot be written.
    """
    page = "\n".join(
        [
            "<!doctype html><html lang=en><meta charset=utf-8>",
            "<meta name=viewport content='width=device-width, initial-scale=1'>",
            f"<title>{html.escape(title)}</title><style>{PALETTE}{STYLE}</style>",
            f"<h1>{html.escape(title)}</h1><p class=lead>{html.escape(lead)}</p>",
            *(part.html() for part in parts),
            "</html>\n",
        ]
    )
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


def _titled(title: str, content: str, folded: bool = False) -> str:
    if folded:
        return f"<details><summary>{html.escape(title)}</summary>{content}</details>"
    return f"<h2>{html.escape(title)}</h2>{content}" if title else content
