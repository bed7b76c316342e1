"""A table in a narrow terminal wraps texts or becomes a list; its numbers stay whole."""

import pytest

from smadrive.cli.list_shipped import HEADER as LIST_HEADER
from smadrive.cli.scan import HEADER as SCAN_HEADER
from smadrive.cli.terminal.output import Output
from smadrive.cli.views.metrics_table import HEADER as RUN_HEADER
from smadrive.runs.cycling.cycle_table import CYCLE_HEADER

LONG = "a T-S fuzzy Duhem model of the wire"
TABLES = {
    "run": (RUN_HEADER, [("tracking", "0.11 %", "0.46 %", "0", "12345")]),
    "cycles": (CYCLE_HEADER, [("100", "11.987", "0.11", "0.46", "16.501", "1234.5", "129.5")]),
    "probe": (("quantity", "value"), [("displacement", "no sensor, or out of its range"), ("current", "0.1234 A")]),
    "watch": (
        ("quantity", "last", "lowest", "highest"),
        [("displacement", "-11.9908 mm", "-11.9909 mm", "12.1234 mm")],
    ),
    "scan": (SCAN_HEADER, [("247", "115200 baud, even parity", "riden-rd60xx or eurotherm-3216")]),
    "list": (LIST_HEADER, [("flexinol-lt-0.15mm", "simulated wire", LONG)]),
    "fit": (("", "value", ""), [("left after a loop", "< 0.01 %", "of an initial error; less is better")]),
    "comparison": (("", "first", "second"), [("highest temperature / °C", "129.1", "129.3 (+0.2)")]),
}
NOTES = {"list", "fit"}


@pytest.fixture(params=sorted(TABLES))
def printed(request, capsys, monkeypatch):
    """Return a function that prints the table on a terminal of a width, and returns its lines."""

    def at(width):
        monkeypatch.setenv("COLUMNS", str(width))
        Output(as_json=False).table(*TABLES[request.param], notes=request.param in NOTES)
        return capsys.readouterr().out.splitlines()

    return at, TABLES[request.param][1]


@pytest.mark.parametrize("width", [20, 30, 40, 60, 80, 200])
def test_no_number_is_cut(printed, width):
    at, rows = printed
    lines = at(width)
    assert "…" not in "".join(lines)
    for cell in (cell for row in rows for cell in row):
        parts = [cell] if cell[0] in "-<0123456789" and len(cell) < 20 else cell.split()
        for part in parts:
            assert any(part in line for line in lines) or not any(map(str.isdigit, part)), (part, lines)
    if lines[0].startswith("┏"):
        assert max(map(len, lines)) <= width


def test_wide_terminal_shows_a_table_and_a_narrow_one_a_list(capsys, monkeypatch):
    for width, begins in ((200, "┏"), (30, "tracking")):
        monkeypatch.setenv("COLUMNS", str(width))
        Output(as_json=False).table(*TABLES["run"])
        assert capsys.readouterr().out.startswith(begins)


def test_cell_with_brackets_is_shown_as_it_is(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    Output(as_json=False).table(("", "run[old].h5"), [("rig[red]", "1")])
    shown = capsys.readouterr().out
    assert "run[old].h5" in shown
    assert "rig[red]" in shown
