"""The terminal of `tune` shows the heater and the pages, while pages are opened and closed."""

import io
import os
import secrets
import sys
import threading
from itertools import pairwise
from pathlib import Path

import pytest

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.tune_view import Changes, TuneView, watched
from smadrive.tuning.page.client_registry import ClientRegistry
from smadrive.tuning.processes import TuningPage

HANG_GUARD_S = 30.0
TOKEN = secrets.token_urlsafe(8)
WITHOUT_PAGE = "no page is open: the run continues; Ctrl-C or `curl -X POST http://127.0.0.1:5006/off` ends it"


@pytest.fixture
def view(rig):
    page = TuningPage(rig.driver_end, port=5006, token=TOKEN, rig_file=Path("rig.toml"), folder=Path())
    return TuneView("a wire", page, rig.driver_end)


def run(rig, view, until_s):
    rig.run(until_s)
    view.tick(rig.ticks[-1])


@pytest.mark.parametrize(
    ("acts", "expected"),
    [
        ((), "heater off; no page is open; Ctrl-C ends the session"),
        (({"act": "arm"},), f"armed, holding; {WITHOUT_PAGE}"),
        (({"act": "arm"}, {"act": "track", "reference": "sine"}), f"armed, tracking; {WITHOUT_PAGE}"),
    ],
    ids=["off", "holding", "tracking"],
)
def test_terminal_shows_the_heater_and_that_no_page_is_open(rig, view, acts, expected):
    for time_s, act in enumerate(acts, 1):
        rig.at(float(time_s), **act)
    seen = []

    def look():
        view.tick(rig.ticks[-1])
        measured = rig.ticks[-1].measurement
        values = f"a wire: {measured.temperature_c:.1f} °C, {measured.current_a:.3f} A"
        seen.append((view.state, str(view.__rich__()).replace("\n", "; "), values))

    rig.do(9.0, look)
    rig.run(until_s=10.0)
    state, picture, values = seen[0]
    assert state == expected
    assert picture == f"{values}; {expected}"


def test_terminal_shows_how_many_pages_are_open_and_whether_one_controls(rig, view):
    run(rig, view, until_s=1.0)
    clients = ClientRegistry(rig.page, TOKEN)
    clients.enter("first")
    assert "; 1 page is open, none controls;" in view.state
    assert clients.claim("first")
    assert "; 1 page is open, one controls;" in view.state
    clients.enter("second")
    clients.leave("first")
    assert "; 1 page is open, none controls;" in view.state
    clients.enter("third")
    assert clients.claim("third")
    assert "; 2 pages are open, one controls;" in view.state
    ClientRegistry(rig.page, TOKEN)  # a restarted page process
    assert "no page is open" in view.state


def test_terminal_shows_a_fault(rig, view):
    rig.at(1.0, "arm")
    rig.do(3.0, rig.device.bench.sensors.faults.open_thermocouple)
    run(rig, view, until_s=6.0)
    assert "heater off; no page is open; Ctrl-C ends the session; fault: " in view.state
    assert "°C" not in view.values


def test_terminal_does_not_say_that_the_heater_is_off_while_current_flows(rig, view):
    seen = []
    rig.do(0.2, lambda: rig.device.bench.plant.faults.short_switch(0.3))
    rig.do(0.8, lambda: seen.append((rig.driver_end.published["mode"], view.state)))
    rig.run(until_s=1.0)
    ((mode, state),) = seen
    assert mode == "off"
    assert "heater off" not in state


def test_terminal_tells_to_cut_the_supply_of_a_heater_that_is_not_confirmed_off(rig, view):
    rig.do(1.0, lambda: rig.device.faults.vanish(3.0))
    rig.do(1.0, rig.page.request_off)
    seen = []
    rig.clock.follow(lambda _: seen.append(view.state.split(";")[0]) if rig.ticks else None)
    rig.run(until_s=6.0)
    alarm = "the heater could NOT be confirmed off: cut its supply"
    assert [state for before, state in pairwise(seen) if state != before] == [alarm, "heater off"]


def test_without_a_terminal_each_change_of_state_is_one_line(rig, view):
    said = []
    changes = Changes(view, said.append)
    rig.at(1.0, "arm")
    rig.at(5.0, "off")
    looks = 200
    for n in range(looks):
        rig.do(8.0 * n / looks, lambda: (view.tick(rig.ticks[-1]), changes.print()))
    rig.run(until_s=9.0)
    assert [line.split(";")[0] for line in said] == ["heater off", "armed, holding", "heater off"]
    assert all(line.endswith(" A)") for line in said)


class Pipe(io.StringIO):
    """Standard output that is no terminal. `has_line` is set by its first line."""

    def __init__(self):
        super().__init__()
        self.has_line = threading.Event()

    def write(self, text):
        written = super().write(text)
        if "\n" in text:
            self.has_line.set()
        return written


def test_pipe_gets_the_state_also_beside_a_terminal(rig, view, monkeypatch):
    run(rig, view, until_s=0.5)
    client, terminal = os.openpty()
    pipe = Pipe()
    with os.fdopen(client, "rb"), os.fdopen(terminal, "w") as stderr:
        monkeypatch.setattr(sys, "stderr", stderr)
        monkeypatch.setattr(sys, "stdout", pipe)
        with watched(view, Output(as_json=False)):
            assert pipe.has_line.wait(HANG_GUARD_S)
    assert pipe.getvalue().startswith("heater off; ")
