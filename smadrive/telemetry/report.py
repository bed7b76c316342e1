"""One self-contained HTML page of a run: figures, plots, provenance. No request leaves the page."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from smadrive.outfile import replacing

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; }
table { border-collapse: collapse; } th, td { padding: .3rem .9rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; } img { max-width: 100%; } figcaption, footer { color: #666; }
figure { margin: 1rem 0; } pre { white-space: pre-wrap; }
"""


@dataclass(frozen=True)
class Plot:
    """A figure with the sentence that tells what to see in it."""

    title: str
    figure: Figure
    caption: str


def write_report(
    path: Path,
    title: str,
    lead: str,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    plots: Sequence[Plot],
    notes: Sequence[str],
) -> None:
    """Write the page to `path`, complete or not at all. DataError when it cannot be written."""
    page = "\n".join(
        [
            "<!doctype html><html lang=en><meta charset=utf-8>",
            f"<title>{html.escape(title)}</title><style>{STYLE}</style>",
            f"<h1>{html.escape(title)}</h1><p>{html.escape(lead)}</p>",
            _table(header, rows),
            *(_plot(plot) for plot in plots),
            "<footer>" + "".join(f"<p>{html.escape(note)}</p>" for note in notes) + "</footer></html>",
        ]
    )
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _plot(plot: Plot) -> str:
    buffer = io.BytesIO()
    plot.figure.savefig(buffer, format="png", dpi=120)
    image = base64.b64encode(buffer.getvalue()).decode("ascii")
    return (
        f"<h2>{html.escape(plot.title)}</h2><figure><img alt='{html.escape(plot.title)}' "
        f"src='data:image/png;base64,{image}'><figcaption>{html.escape(plot.caption)}</figcaption></figure>"
    )
