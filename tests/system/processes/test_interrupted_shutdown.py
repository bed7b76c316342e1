"""Signals during the attempts to switch a silent device off, on a pseudo-terminal and on TCP, in real time."""

import signal
import subprocess
import sys
import time
import tomllib
from contextlib import contextmanager

import programs
import pytest
from marks import exhaustive
from served import served, with_limits

from smadrive.files.shipped import configs_dir
from smadrive.modbus.trace import read_trace
from smadrive.safety.faults import Fault
from smadrive.safety.shutdown import CONFIRMED, UNCONFIRMED

TRIPPED = f"fault {Fault.STALE_DATA.number}:"
PATIENT = "?latency_ms=100"
"""Option of an address: a reply may be late on a busy machine."""

STALE_S = 0.6
WATCHDOG_S = 5.0
"""Limits that even a busy machine keeps."""

FRAMES_OF_A_TICK = 4
"""Greatest number of frames in a tick. More frames, sent after the limit, belong to switching off."""

MANY_FRAMES = 30
"""After this many frames since arming, the loop certainly runs."""


class Driver:
    """`smadrive excite` on a simulated board, with the frames that it sent and received."""

    def __init__(self, process, trace, simulator):
        self.simulator = simulator
        self._process = process
        self._trace = trace

    def frames(self):
        return read_trace(self._trace)[1] if self._trace.exists() else []

    def wait_for(self, happened):
        while not happened(self.frames()):
            assert self._process.poll() is None, self._process.stderr.read()
            time.sleep(0.02)

    def silence_and_wait_for_the_shutdown(self):
        self.simulator.send_signal(signal.SIGSTOP)
        self.wait_for(tries_to_switch_off)

    def wait_for_another_try(self):
        before = len(self.frames())
        self.wait_for(lambda frames: len(frames) > before)

    def send(self, *numbers):
        for number in numbers:
            self._process.send_signal(number)

    def end(self):
        """Wait for the end of the driver, and return its exit code and its output."""
        _, said = self._process.communicate(timeout=300)
        return self._process.returncode, said


def tries_to_switch_off(frames):
    answered_s = max((time_s for time_s, direction, _ in frames if direction == "received"), default=0.0)
    late = [time_s for time_s, direction, _ in frames if direction == "sent" and time_s > answered_s + STALE_S]
    return len(late) > FRAMES_OF_A_TICK


@contextmanager
def heating(tmp_path, way_in):
    with served(way_in, str(tmp_path / "port") if way_in == "--pty" else "0") as (simulator, url):
        rig = (configs_dir() / "rigs" / "simulated.toml").read_text()
        rig = rig.replace(tomllib.loads(rig)["devices"][0]["url"], f"{url}{PATIENT}")
        (tmp_path / "rig.toml").write_text(with_limits(rig, WATCHDOG_S, STALE_S))
        command = [sys.executable, "-m", "smadrive", "excite", "rig.toml", "-o", "l.h5", "--trace", "."]
        with programs.Program(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
            try:
                while "armed" not in simulator.stderr.readline():
                    assert process.poll() is None, process.stderr.read()
                driver = Driver(process, tmp_path / "board.trace", simulator)
                before = len(driver.frames())
                driver.wait_for(lambda frames: len(frames) > before + MANY_FRAMES)
                yield driver
            finally:
                process.kill()
                simulator.send_signal(signal.SIGCONT)


@pytest.fixture(params=["--pty", exhaustive("--rtu-tcp")])
def driver(request, tmp_path):
    with heating(tmp_path, request.param) as driver:
        yield driver


@pytest.mark.parametrize("number", [exhaustive(signal.SIGINT), exhaustive(signal.SIGTERM), signal.SIGHUP])
def test_signal_neither_ends_the_attempts_nor_hides_the_trip(driver, number):
    driver.silence_and_wait_for_the_shutdown()
    driver.send(number)
    driver.wait_for_another_try()
    driver.simulator.send_signal(signal.SIGCONT)
    code, said = driver.end()
    assert code == 4, said
    assert TRIPPED in said
    assert CONFIRMED in said
    assert UNCONFIRMED not in said


@pytest.mark.exhaustive
def test_silent_device_is_reported_as_unconfirmed_despite_two_signals(driver):
    driver.silence_and_wait_for_the_shutdown()
    driver.send(signal.SIGINT, signal.SIGTERM)
    code, said = driver.end()
    assert code == 4, said
    assert TRIPPED in said
    assert said.count(UNCONFIRMED) == 1
    assert CONFIRMED not in said


def test_third_signal_ends_the_attempts_but_hides_neither_trip_nor_outcome(driver):
    driver.silence_and_wait_for_the_shutdown()
    driver.send(signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = len(driver.frames())
    code, said = driver.end()
    assert code == 4, said
    assert TRIPPED in said
    assert said.count(UNCONFIRMED) == 1
    assert len(driver.frames()) <= before + 2


@pytest.mark.exhaustive
def test_interrupted_run_with_a_silent_device_reports_its_outcome(driver):
    driver.send(signal.SIGINT)
    driver.simulator.send_signal(signal.SIGSTOP)
    code, said = driver.end()
    assert code == 130
    assert (CONFIRMED in said) != (UNCONFIRMED in said)
