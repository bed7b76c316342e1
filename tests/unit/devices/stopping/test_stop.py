"""A request to stop: the driver is interrupted, and the asker waits until its line is free."""

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import programs
import pytest

from smadrive.devices.state.lock import Role, lock_line
from smadrive.devices.stopping.endpoint import address_of
from smadrive.devices.stopping.listener import BACKLOG, MOST_ASKERS, StopListener
from smadrive.devices.stopping.request import ANSWERS_WITHIN_S, ask_to_stop
from smadrive.errors import BusyError, SafetyError, StoppedError

DRIVER = """
import signal, sys, time
from smadrive.devices.stopping.listener import StopListener
from smadrive.errors import StoppedError
hangs = sys.argv[2] == "hangs"
signal.signal(signal.SIGINT, signal.SIG_IGN if hangs else signal.default_int_handler)
try:
    with StopListener('driver') as listener:
        listener.listen(sys.argv[1], [sys.argv[1]])
        print("listens", flush=True)
        time.sleep(60)
except StoppedError as stopped:
    print(stopped, flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
STRANGER = """
import os, sys, time
from contextlib import ExitStack
os.setgroups([])
os.setgid(4003)
os.setuid(4003)
from smadrive.devices.stopping.request import ask_to_stop
from smadrive.errors import SafetyError
deadline_s = time.monotonic() + 0.5
try:
    with ExitStack() as stack:
        ask_to_stop(sys.argv[1], sys.argv[1], deadline_s, stack).wait(deadline_s)
except SafetyError as error:
    print(error.where, error.cure, sep="\\n")
"""


def stop_driver(line, within_s=ANSWERS_WITHIN_S):
    """Stop the driver that listens at the name `line`, and return it."""
    deadline_s = time.monotonic() + within_s
    with ExitStack() as stack:
        request = ask_to_stop(line, line, deadline_s, stack)
        return None if request is None else request.wait(deadline_s)


@pytest.fixture
def line(tmp_path):
    """The line of a port that this user alone may open."""
    port = tmp_path / "port"
    port.touch(mode=0o600)
    return f"serial://{port}"


@pytest.fixture
def driver(line):
    """`driver(kind)`: a process that listens at the line, and sleeps when it is "idle" or "hangs"."""
    processes = []

    def start(kind):
        process = programs.Program(
            [sys.executable, "-c", DRIVER, line, kind], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        processes.append(process)
        assert process.stdout.readline() == "listens\n", process.stderr.read()
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_line_without_a_driver_needs_no_stop(line):
    assert stop_driver(line) is None


def test_idle_driver_is_interrupted_and_has_released_its_line(driver, line):
    process = driver("idle")
    stopped = stop_driver(line, 60.0)
    assert (stopped.pid, stopped.killed) == (process.pid, False)
    assert process.communicate()[0] == "driver: stopped by `smadrive off`\n"
    assert stop_driver(line) is None


def test_interruption_without_a_request_is_none(driver):
    process = driver("idle")
    process.send_signal(signal.SIGINT)
    assert process.communicate()[0] == "interrupted\n"


@pytest.mark.parametrize("kind", ["hangs", "stopped", "ended meanwhile"])
def test_driver_that_does_not_answer_is_killed(driver, line, kind):
    process = driver("hangs" if kind == "hangs" else "idle")
    if kind == "stopped":
        process.send_signal(signal.SIGSTOP)
    if kind == "ended meanwhile":
        process.send_signal(signal.SIGSTOP)
        killer = threading.Timer(0.2, process.kill)
        killer.start()
    stopped = stop_driver(line, 0.5 if kind != "ended meanwhile" else 60.0)
    assert (stopped.pid, stopped.killed) == (process.pid, kind != "ended meanwhile")
    assert process.wait() == -signal.SIGKILL
    assert stop_driver(line) is None


def test_process_that_got_the_id_of_an_ended_driver_is_not_killed(driver, line):
    """The listening socket of a driver outlives it in a child, and its process id means another process."""
    process = driver("idle")
    process.send_signal(signal.SIGSTOP)
    deadline_s = time.monotonic() + 0.1
    with ExitStack() as stack:
        request = ask_to_stop(line, line, deadline_s, stack)
        stranger = stack.enter_context(programs.Program([sys.executable, "-c", "input()"], stdin=subprocess.PIPE))
        stack.callback(stranger.kill)
        request = replace(
            request, driver=request.driver._replace(pid=stranger.pid), process=os.pidfd_open(stranger.pid)
        )
        stack.callback(os.close, request.process)
        with pytest.raises(SafetyError) as error:
            request.wait(deadline_s)
        assert error.value.where == line
        assert stranger.poll() is None


def test_several_askers_all_wait_for_the_end(driver, line):
    process = driver("idle")
    process.send_signal(signal.SIGSTOP)
    results = []
    askers = [threading.Thread(target=lambda: results.append(stop_driver(line, 60.0))) for _ in range(3)]
    for asker in askers:
        asker.start()
    time.sleep(0.2)
    process.send_signal(signal.SIGCONT)
    for asker in askers:
        asker.join()
    assert process.communicate()[0] == "driver: stopped by `smadrive off`\n"
    assert all(stopped is None or not stopped.killed for stopped in results)


def test_many_connections_leave_the_driver_its_descriptors(driver, line):
    process = driver("hangs")
    with ExitStack() as stack:
        for _ in range(MOST_ASKERS + 3 * BACKLOG):
            asker = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            asker.setblocking(False)
            with suppress(BlockingIOError):
                asker.connect(address_of(line))
        assert len(list(Path(f"/proc/{process.pid}/fd").iterdir())) < MOST_ASKERS + 20
        assert process.poll() is None


def test_paused_driver_whose_backlog_is_full_is_not_taken_for_no_driver(driver, line):
    process = driver("idle")
    process.send_signal(signal.SIGSTOP)
    while " T " not in Path(f"/proc/{process.pid}/stat").read_text():
        time.sleep(0.01)
    with ExitStack() as stack:
        for _ in range(2 * BACKLOG):
            asker = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            asker.setblocking(False)
            with suppress(BlockingIOError):
                asker.connect(address_of(line))
        with pytest.raises(SafetyError):
            stop_driver(line, within_s=0.2)


def test_forked_child_of_a_driver_does_not_keep_its_line(line):
    fork = multiprocessing.get_context("fork")
    runs = fork.Event()
    with StopListener("driver") as listener, lock_line(line, Role.DRIVER):
        listener.listen(line, [line])
        child = fork.Process(target=lambda: (runs.set(), time.sleep(60)))
        child.start()
        runs.wait()
    try:
        assert stop_driver(line) is None
        with StopListener("driver") as again, lock_line(line, Role.DRIVER):
            again.listen(line, [line])
        assert child.is_alive()
    finally:
        child.kill()
        child.join()


@pytest.mark.parametrize("ending", ["error", "end"])
def test_request_wins_over_the_way_in_which_the_driver_ends(line, ending):
    def drive():
        with StopListener("driver") as listener:
            listener.listen(line, [line])
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asker:
                asker.connect(address_of(line))
                while not listener.requested:
                    time.sleep(0.001)
            if ending == "error":
                raise ValueError

    with ThreadPoolExecutor(1) as pool, pytest.raises(StoppedError) as stopped:
        pool.submit(drive).result()
    assert type(stopped.value.__cause__) is (ValueError if ending == "error" else type(None))


def test_request_is_either_rejected_or_obeyed_while_the_driver_ends(line):
    """A driver that is reported as stopped must not go on to its next run."""
    both = threading.Barrier(2)

    def was_stopped():
        try:
            with StopListener("driver") as listener:
                listener.listen(line, [line])
                both.wait()
        except StoppedError:
            return True
        return False

    def has_asked(round_):
        both.wait()
        time.sleep(1e-5 * (round_ % 20))
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asker:
            return asker.connect_ex(address_of(line)) == 0

    with ThreadPoolExecutor(2) as pool:
        for round_ in range(200):
            driver, asker = pool.submit(was_stopped), pool.submit(has_asked, round_)
            assert driver.result() == asker.result()


def test_second_driver_of_a_line_is_refused(line):
    with StopListener("first") as first, StopListener("second") as second:
        first.listen(line, [line])
        with pytest.raises(BusyError) as error:
            second.listen(line, [line])
        assert error.value.where == line


def test_listener_without_a_line_ends():
    with StopListener("driver") as listener:
        listener.listen("", [])


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can start a program of another user")
def test_user_without_rights_on_the_port_is_refused_and_told_who_has_them(driver, line):
    process = driver("idle")
    refused = programs.run([sys.executable, "-c", STRANGER, line], capture_output=True, text=True, check=True)
    where, cure = refused.stdout.splitlines()
    assert where == line
    assert "root" in cure
    assert process.poll() is None
