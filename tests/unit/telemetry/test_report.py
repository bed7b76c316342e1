"""The report is one file that asks nobody for anything."""

from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from smadrive.errors import DataError
from smadrive.telemetry.report import Plot, write_report


class References(HTMLParser):
    """Collects everything that a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for name, value in attrs if name in {"src", "href"}]


def write(path):
    figure = Figure()
    figure.subplots().plot([0, 1])
    write_report(
        path, "a <title>", "lead & more", ("run", "error"), [("one", "1 %")], [Plot("p", figure, "c")], ["note"]
    )


def test_everything_is_inside_and_text_is_escaped(tmp_path):
    write(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    references = References()
    references.feed(page)
    assert references.found
    assert all(value.startswith("data:image/png;base64,") for value in references.found)
    assert "a &lt;title&gt;" in page
    assert "lead &amp; more" in page
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(DataError, match=r"report\.html: cannot be written"):
        write(tmp_path / "no" / "report.html")
