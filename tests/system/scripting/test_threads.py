"""A rig that several threads of a script use: each may switch off, and no run outlives the main thread."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from signal_injection import InterruptedLine
from waiting import has_ended, has_rows, wait_for

import smadrive
from smadrive.cli import INTERRUPTED
from smadrive.control.controllers.step import ManualStep
from smadrive.errors import ConfigError, LoopProcessError, SafetyError
from smadrive.interrupts import SIGNALS
from smadrive.runs.log.reader import read_log
from smadrive.safety.shutdown import CONFIRMED, UNCONFIRMED
from smadrive.scripting import open_rig, rig_connection
from smadrive.scripting import servo as servo_module
from smadrive.scripting.loop.messages import HeatRequest

DAY_S = 86_400


@contextmanager
def set_at_last(event):
    """Set `event` at the end of the block, also after a failure, so that the thread that waits for it ends."""
    try:
        yield
    finally:
        event.set()


def assert_confirmed(log):
    assert log.end_time
    assert log.ended_by.startswith("interruption")
    assert not any("NOT" in event.message for event in log.events), log.events


@pytest.mark.exhaustive
@pytest.mark.parametrize("act", ["off", "close"])
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


@contextmanager
def blocked_signals():
    """In the block, the signals do not reach the main thread; the processes that begin here inherit this."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@pytest.mark.exhaustive
def test_signals_that_the_script_blocks_reach_its_loop_process(tmp_path):
    with blocked_signals():
        rig = smadrive.open_rig("in-process")
    with rig, ThreadPoolExecutor() as pool:
        run = pool.submit(rig.heat, DAY_S, current_a=0.2, log=tmp_path / "heat.h5")
        wait_for((tmp_path / "heat.h5").exists)
        rig.off()
        assert isinstance(run.exception(), SafetyError)


@pytest.mark.exhaustive
def test_signals_that_the_parent_blocks_reach_a_command(tmp_path):
    command = [sys.executable, "-m", "smadrive", "heat", "in-process", "--current", "0.2", "--for", str(DAY_S)]
    with blocked_signals():
        process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: has_rows(tmp_path / "heat.h5") or process.poll() is not None)
        process.terminate()
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == INTERRUPTED
    assert CONFIRMED in errors


@pytest.mark.exhaustive
def test_run_whose_thread_does_not_go_on_is_ended_by_another_one(tmp_path):
    """The thread hangs in the display of its progress, as at a terminal that Ctrl-S has stopped."""
    shows, goes_on = threading.Event(), threading.Event()

    def hang(_progress):
        shows.set()
        goes_on.wait()

    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        request = HeatRequest(tmp_path / "heat.h5", ManualStep(0.2, None, DAY_S))
        with set_at_last(goes_on):
            run = pool.submit(rig._client.call, request, hang)
            shows.wait()
            off = pool.submit(rig.off)
            wait_for(lambda: has_ended(tmp_path / "heat.h5"))
            assert not off.done()
        assert isinstance(run.exception(), SafetyError)
        assert off.exception() is None
    assert_confirmed(read_log(tmp_path / "heat.h5"))


@contextmanager
def interrupted_at(turns):
    """In the block, interrupt the main thread once while it switches off."""
    is_over = threading.Event()

    def interrupt():
        wait_for(lambda: turns.is_switching_off or is_over.is_set())
        if not is_over.wait(0.2):  # by then it waits for its turn
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with set_at_last(is_over):
        yield
    thread.join()


@pytest.mark.exhaustive
@pytest.mark.parametrize("is_interrupted", [False, True])
def test_request_that_is_not_sent_yet_is_ended(tmp_path, is_interrupted):
    pickles, goes_on = threading.Event(), threading.Event()

    class SlowPath(type(Path())):
        def __reduce__(self):
            pickles.set()
            goes_on.wait()
            return Path, (str(self),)

    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        request = HeatRequest(SlowPath(tmp_path / "heat.h5"), ManualStep(0.2, None, DAY_S))
        with set_at_last(goes_on):
            run = pool.submit(rig._client.call, request)
            pickles.wait()
            if is_interrupted:
                with interrupted_at(rig._client.turns), pytest.raises(KeyboardInterrupt):
                    rig.off()
            else:
                off = pool.submit(rig.off)
                wait_for(lambda: rig._client.turns.is_switching_off)
        assert isinstance(run.exception(), SafetyError)
        assert is_interrupted or off.exception() is None


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


@pytest.mark.exhaustive
def test_servo_that_waits_for_a_run_can_be_stopped(tmp_path, identified, monkeypatch):
    """The run of the other thread goes on: nobody kills the loop process because the servo has not ended."""
    wire = smadrive.load_wire(identified.wire_file)
    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        run = pool.submit(rig.heat, DAY_S, current_a=0.2, log=tmp_path / "heat.h5")
        wait_for((tmp_path / "heat.h5").exists)
        servo = rig.servo(wire, tmp_path / "servo.h5")
        with monkeypatch.context() as patched:
            patched.setattr(servo_module, "STOPS_WITHIN_S", 0.01)
            stop = pool.submit(servo.stop)
            time.sleep(1.0)
        ended = run.done() or stop.done()
        with pytest.raises(SafetyError):
            rig.off()
        assert not ended
        assert isinstance(run.exception(), SafetyError)
        assert isinstance(stop.exception(), SafetyError)


@pytest.mark.exhaustive
def test_interruption_of_off_leaves_no_servo_that_heats(tmp_path, identified):
    wire, at, reached = smadrive.load_wire(identified.wire_file), 0, True
    modules = open_rig, rig_connection, servo_module  # test_turns.py interrupts turns.py
    with smadrive.open_rig("in-process") as rig:
        while reached:
            offs = rig._client.turns._begun_offs
            servo = rig.servo(wire, tmp_path / f"{at}.h5")
            with InterruptedLine(at, *modules, interrupt=partial(signal.raise_signal, signal.SIGINT)) as interruption:
                rig.off()
            if rig._client.turns._begun_offs == offs:  # the interruption came before off() had begun
                servo.stop()
            servo._thread.join(60.0)
            assert not servo.is_running
            assert not rig.measure().armed
            at, reached = at + 1, interruption.reached
    assert at > 25


@pytest.mark.exhaustive
def test_only_one_of_two_threads_gets_a_servo(tmp_path, identified):
    wire = smadrive.load_wire(identified.wire_file)
    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        both = threading.Barrier(2)
        begun = [
            pool.submit(lambda name: (both.wait(), rig.servo(wire, tmp_path / f"{name}.h5")), name) for name in "ab"
        ]
        assert {type(one.exception()) for one in begun} == {ConfigError, type(None)}


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", ["servo", "heat"])
def test_close_tells_that_the_loop_process_died_under_another_thread(tmp_path, identified, kind):
    log, wire = tmp_path / "run.h5", smadrive.load_wire(identified.wire_file)
    with smadrive.open_rig("in-process") as rig, ThreadPoolExecutor() as pool:
        if kind == "servo":
            rig.servo(wire, log)
        else:
            pool.submit(rig.heat, DAY_S, current_a=0.2, log=log)
        wait_for(log.exists)
        os.kill(rig._client.child.pid, signal.SIGKILL)
        wait_for(lambda: not rig._client.is_busy)
        with pytest.raises(LoopProcessError):
            rig.close()


@pytest.mark.exhaustive
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


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("start", "end"),
    [
        (THREAD, "sys.exit()"),
        (THREAD, "pass"),
        (THREAD, "raise KeyboardInterrupt"),
        (POOL, "raise KeyboardInterrupt"),
    ],
)
def test_run_of_a_thread_ends_with_the_main_thread(tmp_path, start, end):
    command = [sys.executable, "-c", OUTLIVES.format(start=start, end=end)]
    done = subprocess.run(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    assert "SafetyError: loop process: the main thread of the script has ended" in done.stderr or start == POOL
    assert UNCONFIRMED not in done.stderr
    assert_confirmed(read_log(tmp_path / "heat.h5"))
