"""The terminal shows a run to a person; a program sees no display."""

import re
import signal
import subprocess
import sys
import threading
import tomllib
import urllib.request
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.error import HTTPError

import programs
import pytest
from brief_rig import brief_rig
from rich.console import Console

from smadrive.cli.views.run_view import RunView
from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.hysteresis import DuhemModel, save_model
from smadrive.measurement import Measurement
from smadrive.runs.log.reader import read_log
from smadrive.runs.log.recorder import Recorder
from smadrive.testing.simulator import ServedSimulator

CONFIGS = Path(__file__).parents[3] / "configs"
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)


def on_a_terminal(*arguments, cwd):
    """Run a command whose stderr is a terminal, and return its output there."""
    return programs.run_on_terminal([sys.executable, "-m", "smadrive", *arguments], cwd)


def test_run_shows_its_values_on_a_terminal(tmp_path):
    seen = on_a_terminal("excite", brief_rig(tmp_path), "-o", "l.h5", cwd=tmp_path)
    for shown in ("exciting", "━", "temperature", "°C", "current", "limited by"):
        assert shown in seen


@pytest.mark.exhaustive
def test_json_leaves_the_terminal_empty(tmp_path):
    assert on_a_terminal("excite", brief_rig(tmp_path), "-o", "l.h5", "--json", cwd=tmp_path) == ""


@pytest.mark.exhaustive
def test_stderr_is_empty_without_a_terminal(tmp_path):
    command = [sys.executable, "-m", "smadrive", "excite", brief_rig(tmp_path), "-o", "l.h5"]
    done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert done.stdout.startswith("l.h5: ")


@contextmanager
def visited(page):
    """Loads the page again and again during the block: the page process drops one that nothing connects to."""
    over = threading.Event()

    def visit():
        while not over.wait(0.2):
            with suppress(HTTPError), urllib.request.urlopen(page) as reply:  # noqa: S310 (503: enough pages are open)
                reply.read()

    visitor = threading.Thread(target=visit)
    visitor.start()
    try:
        yield
    finally:
        over.set()
        visitor.join()


@pytest.mark.exhaustive
def test_tune_prints_its_state_and_its_open_pages(tmp_path):
    save_model(WIRE, tmp_path / "wire.json")
    with ServedSimulator("flexinol-lt-0.15mm", real_time=True) as simulator:
        rig = (CONFIGS / "rigs" / "simulated.toml").read_text()
        url = tomllib.loads(rig)["devices"][0]["url"]
        (tmp_path / "rig.toml").write_text(rig.replace(url, simulator.url))
        command = [sys.executable, "-m", "smadrive", "tune", "rig.toml", "--model", "wire.json"]
        with programs.Program(
            [*command, "--port", "0", "--no-browser"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
        ) as process:
            page = process.stdout.readline().split()[-1]
            alone = process.stdout.readline()
            with visited(page):
                opened = next(line for line in process.stdout if "no page is open" not in line)
            process.send_signal(signal.SIGINT)
            (log_line,) = [line for line in process.communicate()[0].splitlines() if line.startswith("log: ")]
    assert process.returncode == 130
    log = read_log(tmp_path / log_line.removeprefix("log: "))
    assert log.column("time_s").size > 0
    assert "session ended: heater off, confirmed" in [event.message for event in log.events]
    assert log.ended_by.startswith("interruption")
    assert "heater off; no page is open; Ctrl-C ends the session (" in alone
    assert re.search(r"heater off; \d pages? (is|are) open, ", opened)


@pytest.fixture
def recorder(tmp_path):
    with Recorder(tmp_path / "l.h5", ("time_s",)) as recorder:
        yield recorder


def tick(**measured):
    values = {"time_s": 0.0, "temperature_c": 84.06, "current_a": 0.2, "voltage_v": 3.1, "displacement_mm": 4.2}
    return Tick(34.2, 0.0012, Measurement(**{**values, **measured}), Command(0.2, setpoint_c=84.3, setpoint_mm=4.21))


def test_display_has_values_limits_faults_and_events(recorder):
    view = RunView("tracking", 122.0, 0.6, recorder)
    assert "starting" in str(view.__rich__())
    recorder.event("limited by voltage for the first time")
    view.latest = tick(device_limits=("voltage",), host_limits=("derate",), device_faults=("watchdog",))
    lines = " ".join(str(view.__rich__()).split())
    for shown in (
        *("34.2 of 122.0 s", "setpoint 4.210 mm", "displacement 4.200 mm", "error 0.010 mm", "wire setpoint 84.3 °C"),
        *("temperature 84.1 °C", "late 1.2 ms", "current 0.200 A", "limit 0.600 A", "limited by voltage, derate"),
        *("faults watchdog", "limited by voltage for the first time"),
    ):
        assert shown in lines


@pytest.mark.parametrize("width", [200, 120, 80, 79, 60, 53, 40, 30])
def test_display_fits_a_narrow_terminal(recorder, width):
    recorder.event("disarmed")
    view = RunView("tracking", 122.0, 0.6, recorder, lambda: width)
    view.latest = tick(device_faults=("watchdog",))
    lines = str(view.__rich__()).splitlines()
    assert max(map(len, lines)) <= width
    assert len(view.__rich__().wrap(Console(width=width), width)) == len(lines)
    shown = " ".join(" ".join(lines).split())
    for value in ("34.2 of 122.0 s", "setpoint 4.210 mm", "error 0.010 mm", "limited by nothing", "0.00 s: disarmed"):
        assert value in shown


def test_long_event_is_shown_whole(recorder):
    message = "fault 3: " + "the wire is too hot; " * 20 + "let it cool"
    recorder.event(message)
    view = RunView("tracking", 122.0, 0.6, recorder, lambda: 60)
    view.latest = tick()
    lines = view.__rich__().wrap(Console(width=60), 60)
    assert message in " ".join(line.plain.strip() for line in lines)


@pytest.mark.exhaustive
def test_spinner_vanishes(tmp_path, identified):
    log = str(identified.log.path)
    seen = on_a_terminal("identify", log, "-o", "wire.json", cwd=tmp_path)
    assert f"fitting {identified.log.path.name}" in seen
    assert seen.endswith("\x1b[2K")


def test_last_tick_after_the_end_is_shown_at_the_end(recorder):
    view = RunView("tracking", 34.1, 0.6, recorder)
    view.latest = tick()
    assert "34.1 of 34.1 s" in str(view.__rich__())


def test_unknown_values_are_dashes(recorder):
    view = RunView("tracking", float("inf"), 0.6, recorder)
    view.latest = tick(temperature_c=float("nan"), temperature_fault="open", displacement_mm=float("nan"))
    lines = " ".join(str(view.__rich__()).split())
    assert "tracking 34.2 s" in lines
    assert "temperature open" in lines
    assert "displacement –" in lines
    assert "limited by nothing" in lines


@pytest.mark.exhaustive
def test_length_of_a_run_is_announced_before_it_heats(tmp_path):
    command = [sys.executable, "-m", "smadrive", "excite", brief_rig(tmp_path), "-o", "l.h5"]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        announced, ended = process.stdout.readline(), process.stdout.readlines()
    assert re.fullmatch(r"l.h5: the experiment takes \d min \d+ s of virtual time\n", announced)
    assert "the heater is off" in ended[-1]
