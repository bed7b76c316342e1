"""The report is one file that loads nothing else."""

import base64
import html
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.figure import Figure

from smadrive.errors import DataError
from smadrive.runs.plot_style import POINTS, line, panels
from smadrive.runs.report import Banner, Grid, Listing, Notes, Plot, Tiles, write_report


class References(HTMLParser):
    """Collects the addresses that a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for name, value in attrs if name in {"src", "href"}]


def write(path):
    figure = Figure()
    figure.subplots().plot([0, 1])
    write_report(
        path,
        "a <title>",
        "lead & more",
        [
            Banner("bad", "fault <1>"),
            Tiles([("1 %", "err<or")]),
            Grid(("run", "error"), [("one", "1 <%")], "Runs"),
            Plot("p", figure, "c"),
            Listing("model", "a < b"),
            Notes(["note <n>"]),
        ],
    )


def test_page_contains_its_drawings_and_escapes_its_texts(tmp_path):
    write(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    references = References()
    references.feed(page)
    (plot,) = references.found
    kind, _, drawing = plot.partition(",")
    assert kind == "data:image/svg+xml;base64"
    assert "<svg" in base64.b64decode(drawing).decode()
    for text in ("a <title>", "lead & more", "fault <1>", "err<or", "1 <%", "a < b", "note <n>"):
        assert html.escape(text) in page
        assert text not in page
    assert "url(" not in page
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


def test_long_line_keeps_its_spikes_with_few_points():
    values = np.zeros(100_000)
    values[[12_345, 54_321]] = 7.0, -3.0
    values[60_000:70_000] = np.nan
    _, (ax,) = panels((2.0,))
    line(ax, np.arange(values.size), values)
    (drawn,) = ax.lines
    assert len(drawn.get_xdata()) <= POINTS
    assert dict(zip(drawn.get_xdata(), drawn.get_ydata(), strict=True))[12_345] == 7.0
    assert np.nanmin(drawn.get_ydata()) == -3.0


def test_path_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(DataError) as error:
        write(tmp_path / "no" / "report.html")
    assert error.value.where == str(tmp_path / "no" / "report.html")
