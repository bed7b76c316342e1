"""A rig that several threads of a script use: each may switch off, and no run outlives the main thread."""

import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from marks import exhaustive

import smadrive
from smadrive.control.controllers.step import ManualStep
from smadrive.errors import SafetyError
from smadrive.runs.log.reader import read_log
from smadrive.safety.shutdown import UNCONFIRMED
from smadrive.scripting.loop.messages import HeatRequest

DAY_S = 86_400


def wait_for(condition):
    while not condition():
        time.sleep(0.01)


def assert_confirmed(log):
    assert log.end_time
    assert log.ended_by.startswith("interruption")
    assert not any("NOT" in event.message for event in log.events), log.events


@pytest.mark.parametrize("act", ["off", exhaustive("close")])
def test_another_thread_ends_a_run_and_those_that_wait_behind_it(tmp_path, act):
    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        runs = [pool.submit(rig.heat, DAY_S, current_a=0.2, log=tmp_path / f"{name}.h5") for name in "abc"]
        wait_for(lambda: any(tmp_path.glob("*.h5")))
        getattr(rig, act)()
        assert rig.is_open == (act == "off")
        while act == "off" and not all(run.done() for run in runs):  # one may not have begun yet
            rig.off()
        ends = [type(run.exception()) for run in runs]
    assert set(ends) == {SafetyError} if act == "off" else SafetyError in ends
    for log in tmp_path.glob("*.h5"):
        assert_confirmed(read_log(log))


@pytest.mark.exhaustive
def test_run_whose_thread_does_not_go_on_is_ended_by_another_one(tmp_path):
    """The thread hangs in the display of its progress, as at a terminal that Ctrl-S has stopped."""
    shows, goes_on = threading.Event(), threading.Event()

    def hang(_progress):
        shows.set()
        goes_on.wait()

    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        request = HeatRequest(tmp_path / "heat.h5", ManualStep(0.2, None, DAY_S))
        run = pool.submit(rig._client.call, request, hang)
        shows.wait()
        off = pool.submit(rig.off)
        wait_for(lambda: read_log(tmp_path / "heat.h5").end_time)
        assert not off.done()
        goes_on.set()
        assert isinstance(run.exception(), SafetyError)
        assert off.exception() is None
    assert_confirmed(read_log(tmp_path / "heat.h5"))


@pytest.mark.exhaustive
def test_request_that_is_not_sent_yet_is_ended(tmp_path):
    pickles, goes_on = threading.Event(), threading.Event()

    class SlowPath(type(Path())):
        def __reduce__(self):
            pickles.set()
            goes_on.wait()
            return Path, (str(self),)

    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        request = HeatRequest(SlowPath(tmp_path / "heat.h5"), ManualStep(0.2, None, DAY_S))
        run = pool.submit(rig._client.call, request)
        pickles.wait()
        off = pool.submit(rig.off)
        wait_for(lambda: rig._client.turns.is_switching_off)
        goes_on.set()
        assert isinstance(run.exception(), SafetyError)
        assert off.exception() is None


@pytest.mark.exhaustive
def test_servo_that_waits_for_a_run_does_not_keep_off_waiting(tmp_path, identified):
    wire = smadrive.load_wire(identified.wire_file)
    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        run = pool.submit(rig.heat, DAY_S, current_a=0.2, log=tmp_path / "heat.h5")
        wait_for((tmp_path / "heat.h5").exists)
        servo = rig.servo(wire, tmp_path / "servo.h5")
        with pytest.raises(SafetyError):
            rig.off()
        assert isinstance(run.exception(), SafetyError)
        assert isinstance(servo.error, SafetyError)
        assert not (tmp_path / "servo.h5").exists()
        assert not rig.measure().armed


def test_two_threads_close_one_rig():
    rig = smadrive.open_rig("in-process")
    with ThreadPoolExecutor() as pool:
        both = threading.Barrier(2)
        closed = [pool.submit(lambda: (both.wait(), rig.close())) for _ in range(2)]
        assert [one.exception() for one in closed] == [None, None]
    assert not rig.is_open


OUTLIVES = """
import pathlib, sys, threading, time, smadrive
from concurrent.futures import ThreadPoolExecutor

def run():
    with smadrive.open_rig("in-process") as rig:
        rig.heat(86_400, current_a=0.2, log="heat.h5")

{start}
while not pathlib.Path("heat.h5").exists():
    time.sleep(0.01)
{end}
"""


THREAD, POOL = "threading.Thread(target=run).start()", "ThreadPoolExecutor().submit(run)"


@pytest.mark.parametrize(
    ("start", "end"),
    [
        (THREAD, "sys.exit()"),
        exhaustive(THREAD, "pass"),
        exhaustive(THREAD, "raise KeyboardInterrupt"),
        exhaustive(POOL, "raise KeyboardInterrupt"),
    ],
)
def test_run_of_a_thread_ends_with_the_main_thread(tmp_path, start, end):
    command = [sys.executable, "-c", OUTLIVES.format(start=start, end=end)]
    done = subprocess.run(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    assert "SafetyError: loop process: the main thread of the script has ended" in done.stderr or start == POOL
    assert UNCONFIRMED not in done.stderr
    assert_confirmed(read_log(tmp_path / "heat.h5"))
