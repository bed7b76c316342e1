"""`watch` shows a rig without heat: live values, lines, JSON lines, a log; the key q ends it."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import tomllib
from dataclasses import asdict
from http.client import HTTPConnection
from math import nan
from urllib.parse import urlsplit

import numpy as np
import programs
import pytest
from rich.console import Console
from served import PATIENT, served

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.cli.views.watch_view import LEVELS, WINDOW_S, Extremes, WatchView, plot_lines
from smadrive.clock import VirtualClock
from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.errors import DataError, DeadlineError
from smadrive.files.shipped import configs_dir
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import LOST_S, observe
from smadrive.runs.figures.log_plots import log_plots
from smadrive.runs.log.reader import read_log
from smadrive.runs.replay import replay

CONFIG = load_rig("in-process")


def watch(folder, *arguments):
    command = [sys.executable, "-m", "smadrive", "watch", *arguments]
    return programs.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_json_lines_and_log_hold_every_measurement(tmp_path):
    done = watch(tmp_path, "in-process", "--for", "2", "--json", "-o", "seen.h5")
    assert (done.returncode, done.stderr) == (0, "")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == 41
    assert not any(line["armed"] or line["in_force_a"] for line in lines)
    assert lines[-1]["time_s"] == pytest.approx(2.0, abs=0.01)
    log = read_log(tmp_path / "seen.h5")
    assert log.column("temperature_c").tolist() == [line["temperature_c"] for line in lines]
    assert not log.column("commanded_a").any()
    with pytest.raises(DataError):
        replay(log)
    (plane,) = (plot for plot in log_plots(log) if plot.title == "Temperature and displacement")
    assert "measured temperature" in plane.caption
    assert np.isfinite(plane.figure.axes[0].collections[0].get_offsets()).all()


def test_pipe_gets_a_line_a_second_and_a_table(tmp_path):
    done = watch(tmp_path, "in-process", "--for", "3")
    assert done.returncode == 0, done.stderr
    times = [line.partition(" s:")[0] for line in done.stdout.splitlines() if " s: " in line]
    assert times == ["0.0", "1.0", "2.0", "3.0"]
    assert "61 measurements" in done.stdout
    assert "highest" in done.stdout


def test_pipe_gets_the_lines_also_beside_a_terminal(tmp_path):
    client, terminal = os.openpty()
    command = [sys.executable, "-m", "smadrive", "watch", "in-process", "--for", "3"]
    done = programs.run(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=terminal, text=True, check=True)
    os.close(terminal)
    os.close(client)
    times = [line.partition(" s:")[0] for line in done.stdout.splitlines() if " s: " in line]
    assert times == ["0.0", "1.0", "2.0", "3.0"]


def test_one_measurement_is_named_in_the_singular(tmp_path):
    assert "1 measurement\n" in watch(tmp_path, "in-process", "--for", "0.01").stdout


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 130)])
def test_interrupt_is_a_normal_end_and_a_termination_is_not(tmp_path, number, code):
    command = [sys.executable, "-m", "smadrive", "watch", "in-process", "--for", "1e9"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with programs.Program(command, cwd=tmp_path, text=True, **streams) as process:
        assert "0.0 s: " in process.stdout.readline()
        process.send_signal(number)
        output, errors = process.communicate()
    assert process.returncode == code
    assert "highest" in output
    assert ("interrupted" in errors) == (code == 130)


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (("in-process",), 2, "is virtual"),
        (("in-process", "--for", "0"), 2, "above 0 s"),
        (("in-process", "--for", "nan"), 2, "--for: not a number"),
        (("in-process", "--for", "1", "-o", "seen.csv"), 2, ".h5"),
        (("absent.toml", "--for", "1"), 2, "absent.toml"),
        (("in-process", "--for", "1", "--port", "0"), 2, "--port"),
        (("in-process", "--for", "1", "--no-browser"), 2, "--browser"),
        (("in-process", "--for", "1", "--page", "--no-browser"), 2, "is virtual"),
        (("in-process", "--for", "1", "--page", "--json"), 2, "--json"),
    ],
)
def test_mistake_is_one_sentence(tmp_path, arguments, code, part):
    done = watch(tmp_path, *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert part in done.stderr
    assert "Traceback" not in done.stderr


def answered(address, method, path):
    """Return the body of the reply to a request to the page."""
    connection = HTTPConnection(address.hostname, address.port)
    connection.request(method, path)
    with contextlib.closing(connection):
        return connection.getresponse().read().decode()


@pytest.mark.exhaustive
def test_page_shows_every_measurement_without_controls_and_ends_with_the_command(tmp_path):
    with served("--pty", str(tmp_path / "port")) as (_, url):
        rig = (configs_dir() / "rigs" / "simulated.toml").read_text()
        (tmp_path / "rig.toml").write_text(rig.replace(tomllib.loads(rig)["devices"][0]["url"], url + PATIENT))
        command = [sys.executable, "-m", "smadrive", "watch", "rig.toml", "--page", "--port", "0", "--no-browser"]
        with programs.Program(
            command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as watching:
            address = urlsplit(watching.stdout.readline().split()[-1])
            text = answered(address, "GET", "/")
            assert json.loads(answered(address, "POST", "/off")) == {"off": "requested"}
            said, errors = watching.communicate()
    assert "simulated bench" in text
    assert 'id="off"' not in text
    assert "bk-Slider" not in text
    assert (watching.returncode, errors) == (0, "")
    assert "measurements" in said


@pytest.fixture
def opened():
    device = simulated_device(load_sim("flexinol-lt-0.15mm"))
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    with Rig(load_rig("in-process"), transports={"board": device.transport(clock)}) as rig:
        yield device, rig


def test_lost_exchanges_are_left_out(opened):
    device, rig = opened
    seen = []

    def record(tick):
        seen.append(tick.time_s)
        if len(seen) == 3:
            device.faults.drop(4)

    observe(rig, 3.0, record, lambda: len(seen) >= 10)
    assert len(seen) == 10
    assert seen == sorted(seen)
    assert seen[3] - seen[2] > 0.1


def test_bus_counters_tell_how_many_requests_failed_and_why(opened):
    device, rig = opened
    before = asdict(rig.bus_counters["board"])
    device.faults.drop(3)
    observe(rig, 2.0, lambda _tick: None, lambda: False)
    (name, counters), *others = rig.bus_counters.items()
    assert (name, others) == ("board", [])
    assert counters.timeouts - before["timeouts"] == 3
    assert counters.requests == counters.replies + 3
    assert str(counters) == f"{counters.requests} requests, 3 failed: 3 timeouts"


def test_silent_device_ends_the_observation(opened):
    device, rig = opened
    device.faults.drop(10_000)
    begun_s = rig.clock.now_s()
    with pytest.raises(DeadlineError):
        observe(rig, 100.0, lambda _tick: None, lambda: False)
    assert LOST_S < rig.clock.now_s() - begun_s < 2.0 * LOST_S
    device.faults.clear()


def tick(time_s, temperature_c, displacement_mm=nan, current_a=0.0, **fields):
    measurement = Measurement(time_s, temperature_c, current_a, 0.0, displacement_mm, **fields)
    return Tick(time_s, 0.0, measurement, Command(0.0))


def test_display_has_values_plot_and_faults():
    view = WatchView(CONFIG, lambda: 60)
    for n in range(100):
        view.tick(tick(float(n), 20.0 + n))
    view.tick(tick(100.0, nan, temperature_fault="open", device_faults=("thermocouple_open",)))
    console = Console(width=60, file=io.StringIO(), record=True)
    console.print(view)
    text = console.export_text()
    for part in ("100.0 s, heater off", "open", "thermocouple_open", "displacement –", LEVELS[-1], "119.00"):
        assert part in text
    assert max(map(len, text.splitlines())) <= 60


@pytest.mark.parametrize(("current_a", "is_off"), [(0.0, True), (0.3, False)])
def test_display_does_not_say_that_the_heater_is_off_while_current_flows(current_a, is_off):
    view = WatchView(CONFIG, lambda: 60)
    view.tick(tick(1.0, 20.0, current_a=current_a))
    assert ("heater off" in view.__rich__().plain) is is_off


def test_plot_rises_from_the_left_to_the_present():
    lines = plot_lines([(float(n), float(n)) for n in range(121)], 10, 1.0, 1)
    assert len(lines) == 4
    assert "120.0" in lines[0]
    tops = [line[-10:] for line in lines]
    assert tops[0].strip() == tops[0][-3:].strip()
    assert tops[-1][-1] == LEVELS[-1]
    assert WINDOW_S == 60.0


def test_plot_of_a_constant_value_has_the_smallest_span():
    lines = plot_lines([(0.0, 5.0), (1.0, nan), (2.0, 5.0)], 20, 1.0, 1)
    assert "5.5" in lines[0]
    assert "4.5" in lines[-1]


def test_extremes_leave_out_what_is_invalid():
    extremes = Extremes()
    for one in (tick(0.0, 20.0), tick(1.0, nan), tick(2.0, 25.0)):
        extremes.add(one)
    rows = {name: values for name, *values in extremes.rows()}
    assert rows["temperature"] == ["25.00 °C", "20.00 °C", "25.00 °C"]
    assert rows["displacement"] == ["–", "–", "–"]


KEY = """
import os, pty, sys, termios, time
from smadrive.cli.views.keyboard import end_key
pid, ours = pty.fork()
if pid == 0:
    before = termios.tcgetattr(0)
    with end_key() as is_ended:
        os.write(1, b"ready")
        while not is_ended():
            time.sleep(0.01)
    os._exit(0 if termios.tcgetattr(0) == before else 1)
assert os.read(ours, 5) == b"ready"
os.write(ours, b"xq")
sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""


def test_key_q_ends_and_the_terminal_is_restored():
    subprocess.run([sys.executable, "-c", KEY], check=True, timeout=60)


def test_input_that_is_no_terminal_never_ends():
    code = "from smadrive.cli.views.keyboard import end_key\nwith end_key() as f: assert not f()"
    subprocess.run([sys.executable, "-c", code], check=True, stdin=subprocess.DEVNULL)
