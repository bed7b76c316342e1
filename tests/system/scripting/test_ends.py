"""However a script or its loop ends, the run ends at zero current: interrupted, killed, stopped, hung, in real time."""

import contextlib
import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import programs
import pytest
from marks import exhaustive
from process_tree import children
from served import PATIENT, served, with_limits
from waiting import has_ended, wait_for

import smadrive
from smadrive.errors import BusyError, LoopProcessError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.safety.shutdown import CONFIRMED, UNCONFIRMED
from smadrive.scripting.loop.client.loop_client import LoopClient
from smadrive.scripting.loop.script_process import STOPPED_S

RIGS = Path(__file__).parents[3] / "configs" / "rigs"

PATIENCE_S = 5.0
"""A limit that a busy machine keeps."""

SCRIPT = """
import os, sys, time
import smadrive
from smadrive.safety.shutdown import shutdown_of

class Warm:
    duration_s = float("inf")
    said = 0.0
    def update(self, time_s, measurement, dt_s):
        if time_s > self.said + 1.0:
            self.said = time_s
            print("heating", os.getpid(), flush=True)
            {fate}
        return smadrive.Command(0.2)

rig = smadrive.open_rig(sys.argv[1])
try:
    rig.drive(Warm(), sys.argv[2], "run.h5")
except BaseException as error:
    print(type(error).__name__, shutdown_of(error), *error.__notes__, sep="; ", flush=True)
    print("says:", error, flush=True)
print("armed:", rig.measure().armed, flush=True)
rig.close()
"""
HANGS = {
    "waits": "time.sleep(1e6)",
    "computes": "while True: pass",
    "drops every exception": "try: time.sleep(1e6)\n            except: pass",
}


@pytest.fixture(params=["in-process", exhaustive("served")])
def rig_file(request, tmp_path):
    """A rig file: simulated in the process of the loop in virtual time, or on a virtual serial port in real time."""
    if request.param == "in-process":
        yield RIGS / "in-process.toml"
        return
    with on_a_port(tmp_path) as (path, _):
        yield path


@contextlib.contextmanager
def on_a_port(tmp_path, watchdog_s=PATIENCE_S, stale_after_s=PATIENCE_S):
    """The rig file of a board that `firmware-sim` serves in real time, and the process of that."""
    with served() as (simulator, url):
        text = (RIGS / "simulated.toml").read_text()
        shipped = tomllib.loads(text)["devices"][0]["url"]
        path = tmp_path / "rig.toml"
        text = text.replace(shipped, url.split("?")[0] + PATIENT)
        path.write_text(with_limits(text, watchdog_s, stale_after_s))
        with number_kept(url):
            yield path, simulator


@contextlib.contextmanager
def number_kept(url):
    """Keep the number of a pseudo-terminal in use after its simulator has ended.

    Otherwise another test could get this number, and its `off` would stop the driver of this test.
    """
    slave = os.open(url.removeprefix("serial://").split("?")[0], os.O_RDWR | os.O_NOCTTY)
    try:
        yield
    finally:
        os.close(slave)


@contextlib.contextmanager
def heating(rig_file, wire_file, tmp_path, fate="pass"):
    """A script whose run heats: its process, and the process id of its loop."""
    command = [sys.executable, "-c", SCRIPT.format(fate=fate), str(rig_file), str(wire_file)]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as script:
        said = script.stdout.readline().split()
        assert said[:1] == ["heating"], script.communicate()
        try:
            yield script, int(said[1])
        finally:
            script.kill()
            wait_for(lambda: not programs.lives(int(said[1])))


def assert_off(rig_file):
    """The device itself is off, and not by its watchdog."""
    with Rig(load_rig(str(rig_file))) as rig:
        measurement = rig.measure()
    assert not measurement.armed
    assert measurement.device_faults == ()


def assert_confirmed(log):
    """The log is complete, and its last events say that an interruption ended the run."""
    assert log.end_time
    assert log.ended_by.startswith("interruption")
    assert not any("NOT" in event.message for event in log.events), log.events


@pytest.mark.parametrize("fate", ["pass", *map(exhaustive, HANGS.values())], ids=["runs", *HANGS])
def test_interruption_ends_the_run_confirmed_and_reaches_the_script(rig_file, identified, tmp_path, fate):
    with heating(rig_file, identified.wire_file, tmp_path, fate) as (script, _):
        script.send_signal(signal.SIGINT)
        printed, errors = script.communicate()
    assert f"KeyboardInterrupt; {CONFIRMED}; the record of the run up to its end: run.h5\n" in printed
    assert f"says: {CONFIRMED}\n" in printed
    assert (printed.splitlines()[-1], script.returncode, errors) == ("armed: False", 0, "")
    assert_confirmed(read_log(tmp_path / "run.h5"))


RESTORED = """
import sys, time
import smadrive

class Warm:
    duration_s = 20.0
    def __getstate__(self):
        return {{"model": 1}}
    def __setstate__(self, state):
        print("restoring", flush=True)
        {fate}
    def update(self, time_s, measurement, dt_s):
        return smadrive.Command(0.2)

with smadrive.open_rig(sys.argv[1]) as rig:
    try:
        rig.drive(Warm(), sys.argv[2], "run.h5")
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    print("armed:", rig.measure().armed, flush=True)
"""
RESTORES = {
    "waits": "time.sleep(5.0)",
    "drops every exception": "try: time.sleep(5.0)\n        except: pass",
}


@pytest.mark.exhaustive
@pytest.mark.parametrize("fate", [RESTORES["waits"], exhaustive(RESTORES["drops every exception"])], ids=RESTORES)
def test_interruption_while_a_controller_is_restored_prevents_the_run(identified, tmp_path, fate):
    command = [sys.executable, "-c", RESTORED.format(fate=fate), str(RIGS / "in-process.toml"), identified.wire_file]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as script:
        assert script.stdout.readline() == "restoring\n"
        script.send_signal(signal.SIGINT)
        printed, errors = script.communicate()
    assert (printed, script.returncode, errors) == ("interrupted\narmed: False\n", 0, "")
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize("end", [signal.SIGKILL, exhaustive(signal.SIGTERM)], ids=lambda end: end.name)
def test_killed_script_ends_the_run_confirmed(rig_file, identified, tmp_path, end):
    with heating(rig_file, identified.wire_file, tmp_path) as (script, loop):
        script.send_signal(end)
        script.communicate()
        wait_for(lambda: not programs.lives(loop))
    assert_confirmed(read_log(tmp_path / "run.h5"))
    assert_off(rig_file)


@pytest.mark.exhaustive
def test_killed_script_ends_the_run_although_its_child_keeps_the_link_open(identified, tmp_path):
    fork = "if os.fork() == 0: time.sleep(1e6)"
    text = SCRIPT.format(fate="pass").replace("try:\n", f"{fork}\ntry:\n", 1)
    command = [sys.executable, "-c", text, str(RIGS / "in-process.toml"), str(identified.wire_file)]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as script:
        loop = int(script.stdout.readline().split()[1])
        started = children(script.pid)
        script.kill()
        try:
            wait_for(lambda: not programs.lives(loop))
        finally:
            for child in started:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
    assert_confirmed(read_log(tmp_path / "run.h5"))


def test_killed_loop_is_an_error_and_the_watchdog_switches_off(identified, tmp_path):
    with on_a_port(tmp_path, watchdog_s=0.5) as (rig_file, simulator):
        with heating(rig_file, identified.wire_file, tmp_path) as (script, loop):
            while 0.2 not in read_log(tmp_path / "run.h5").column("commanded_a"):
                time.sleep(0.05)
            os.kill(loop, signal.SIGKILL)
            printed, errors = script.communicate()
        assert "LoopProcessError" in printed
        assert "the record of the run up to its end: run.h5" in printed
        assert "signal SIGKILL" in errors
        assert any("watchdog" in line for line in simulator.stderr)  # it has switched off before the next driver comes
        with Rig(load_rig(str(rig_file))) as rig:
            assert rig.measure().device_faults == ("watchdog",)
            assert rig.measure().current_a < 0.01
    log = read_log(tmp_path / "run.h5")
    assert log.end_time == ""
    assert log.column("commanded_a").max() == 0.2


@pytest.mark.exhaustive
def test_lost_device_is_a_trip_that_says_that_off_is_unconfirmed(identified, tmp_path):
    with (
        on_a_port(tmp_path, watchdog_s=0.5, stale_after_s=0.5) as (rig_file, simulator),
        heating(rig_file, identified.wire_file, tmp_path) as (script, _),
    ):
        simulator.kill()
        printed, _ = script.communicate()
    assert f"TripError; {UNCONFIRMED}" in printed
    assert "TripError: fault" in read_log(tmp_path / "run.h5").ended_by


@pytest.mark.exhaustive
def test_terminated_loop_ends_its_run_confirmed(rig_file, identified, tmp_path):
    with heating(rig_file, identified.wire_file, tmp_path) as (script, loop):
        os.kill(loop, signal.SIGTERM)
        printed, _ = script.communicate()
    assert "LoopProcessError" in printed
    assert_confirmed(read_log(tmp_path / "run.h5"))
    assert_off(rig_file)


@pytest.mark.exhaustive
def test_stopped_script_does_not_stop_the_loop(identified, tmp_path):
    with on_a_port(tmp_path) as (rig_file, _), heating(rig_file, identified.wire_file, tmp_path) as (script, _):
        script.send_signal(signal.SIGSTOP)
        for _ in range(3):
            assert script.stdout.readline().startswith("heating")
        script.send_signal(signal.SIGCONT)
        script.send_signal(signal.SIGINT)
        script.communicate()
        assert_off(rig_file)
    log = read_log(tmp_path / "run.h5")
    assert_confirmed(log)
    assert log.column("time_s")[-1] > 4.0


@pytest.mark.exhaustive
def test_script_that_is_stopped_for_long_heats_no_longer(identified, tmp_path):
    with on_a_port(tmp_path) as (rig_file, _), heating(rig_file, identified.wire_file, tmp_path) as (script, _):
        script.send_signal(signal.SIGSTOP)
        wait_for(lambda: has_ended(tmp_path / "run.h5"))
        script.send_signal(signal.SIGCONT)
        printed, _ = script.communicate()
        assert f"SafetyError; {CONFIRMED}" in printed
        assert "armed: False" in printed
    log = read_log(tmp_path / "run.h5")
    assert_confirmed(log)
    assert log.column("time_s")[-1] > STOPPED_S


def kill_and_measure(rig):
    os.kill(rig._client.child.pid, signal.SIGKILL)
    rig.measure()


@pytest.mark.exhaustive
def test_idle_loop_that_is_killed_is_an_error_once():
    rig = smadrive.open_rig("in-process")
    with rig, pytest.raises(LoopProcessError) as caught:
        kill_and_measure(rig)
    assert caught.value.value == "signal SIGKILL"
    assert not rig.is_open


@pytest.mark.exhaustive
def test_idle_loop_that_was_stopped_has_not_died():
    rig = smadrive.open_rig("in-process")
    os.kill(rig._client.child.pid, signal.SIGTERM)
    wait_for(lambda: rig._client.is_lost)
    with rig, pytest.raises(LoopProcessError) as caught:
        rig.measure()
    assert (caught.value.value, caught.value.cure) == (None, "open the rig again")


@pytest.mark.exhaustive
def test_rig_that_a_script_opens_twice_is_busy_by_this_script(tmp_path):
    with on_a_port(tmp_path) as (rig_file, _), smadrive.open_rig(rig_file) as rig:
        with pytest.raises(BusyError, match="this script") as refused:
            smadrive.open_rig(rig_file)
        assert refused.value.where.startswith(rig.config.devices[0].url)
        assert not rig.measure().armed
    with smadrive.open_rig("in-process") as one, smadrive.open_rig("in-process") as other:
        assert one.is_open
        assert other.is_open


@pytest.mark.exhaustive
def test_forgotten_rig_ends_its_process():
    rig = smadrive.open_rig("in-process")
    loop = rig._client.child.pid
    del rig
    wait_for(lambda: not programs.lives(loop))


@pytest.mark.exhaustive
def test_script_that_ends_without_closing_leaves_no_process(tmp_path):
    text = "import smadrive; rig = smadrive.open_rig('in-process'); print(rig._client.child.pid)"
    done = programs.run([sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True, check=True)
    wait_for(lambda: not programs.lives(int(done.stdout)))
    assert done.stderr == ""


@pytest.mark.exhaustive
def test_script_that_ends_while_its_device_is_silent_shows_that_off_is_unconfirmed(tmp_path):
    text = "import os, signal, smadrive, sys; rig = smadrive.open_rig(sys.argv[1]); os.kill(int(sys.argv[2]), 9)"
    with on_a_port(tmp_path) as (rig_file, simulator):
        command = [sys.executable, "-c", text, str(rig_file), str(simulator.pid)]
        done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert UNCONFIRMED in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.exhaustive
def test_ended_client_is_ended_again_without_an_error():
    client = LoopClient()
    client.end()
    client.end()
    assert not programs.lives(client.child.pid)
    wait_for(lambda: client.is_lost)
