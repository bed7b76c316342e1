"""What `tune` tells in its terminal, of a session whose pages come and go."""

import secrets
from pathlib import Path

import pytest

from smadrive.cli.views.tune_view import Changes, TuneView
from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.processes import TuningPage

TOKEN = secrets.token_urlsafe(8)
ON_AND_ON = "no page is open: the wire is driven on; Ctrl-C or `curl -X POST http://127.0.0.1:5006/off` ends it"


@pytest.fixture
def view(bench):
    page = TuningPage(bench.control, port=5006, token=TOKEN, rig_file=Path("rig.toml"), folder=Path())
    return TuneView("a wire", page, bench.control)


def run(bench, view, until_s):
    bench.run(until_s)
    view.tick(bench.ticks[-1])


@pytest.mark.parametrize(
    ("acts", "told"),
    [
        ((), "heater off; no page is open; Ctrl-C ends"),
        (({"act": "arm"},), f"armed, holding; {ON_AND_ON}"),
        (({"act": "arm"}, {"act": "track", "reference": "sine"}), f"armed, tracking; {ON_AND_ON}"),
    ],
    ids=["off", "holding", "tracking"],
)
def test_it_tells_what_the_heater_does_and_that_nobody_watches(bench, view, acts, told):
    for time_s, act in enumerate(acts, 1):
        bench.at(float(time_s), **act)
    seen = []

    def look():
        view.tick(bench.ticks[-1])
        measured = bench.ticks[-1].measurement
        values = f"a wire: {measured.temperature_c:.1f} °C, {measured.current_a:.3f} A"
        seen.append((view.state, str(view.__rich__()).replace("\n", "; "), values))

    bench.do(9.0, look)
    bench.run(until_s=10.0)
    state, picture, values = seen[0]
    assert state == told
    assert picture == f"{values}; {told}"


def test_it_tells_how_many_pages_are_open_and_whether_one_controls(bench, view):
    run(bench, view, until_s=1.0)
    desk = ClientRegistry(bench.page, TOKEN)
    desk.enter("first")
    assert "; 1 page is open, none controls;" in view.state
    assert desk.claim("first")
    assert "; 1 page is open, one controls;" in view.state
    desk.enter("second")
    desk.leave("first")
    assert "; 1 page is open, none controls;" in view.state
    desk.enter("third")
    assert desk.claim("third")
    assert "; 2 pages are open, one controls;" in view.state
    ClientRegistry(bench.page, TOKEN)  # a page process that was started anew
    assert "no page is open" in view.state


def test_a_fault_is_told(bench, view):
    bench.at(1.0, "arm")
    bench.do(3.0, bench.device.bench.sensors.faults.open_thermocouple)
    run(bench, view, until_s=6.0)
    assert "heater off; no page is open; Ctrl-C ends; fault: " in view.state
    assert "°C" not in view.values


def test_without_a_terminal_a_change_is_a_line_and_a_value_is_none(bench, view):
    said = []
    changes = Changes(view, said.append)
    bench.at(1.0, "arm")
    bench.at(5.0, "off")
    looks = 200
    for n in range(looks):
        bench.do(8.0 * n / looks, lambda: (view.tick(bench.ticks[-1]), changes.tell()))
    bench.run(until_s=9.0)
    assert [line.split(";")[0] for line in said] == ["heater off", "armed, holding", "heater off"]
    assert all(line.endswith(" A)") for line in said)
