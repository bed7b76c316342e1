"""The lock of a line admits one client, is shared with its guardian, and is released by the kernel."""

import fcntl
import os
import signal
import subprocess
import sys
import threading

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state import lock as locks
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import Role, holder_of, lines_of, lock_line
from smadrive.errors import BusyError

LINE = "serial:///dev/ttyUSB0"
HOLDS = """
import sys, time
from smadrive.devices.state.lock import Role, lock_line
lock = lock_line(sys.argv[1], Role(sys.argv[2]), 0.0)
print("holds", flush=True)
time.sleep(60)
"""
INHERITS = "import sys; print('holds', flush=True); sys.stdin.read()"


@pytest.fixture
def held():
    """Return `held(line, role)`, which starts a process that holds the lock."""
    processes = []

    def start(line, role):
        process = subprocess.Popen([sys.executable, "-c", HOLDS, line, role], stdout=subprocess.PIPE, text=True)
        processes.append(process)
        assert process.stdout.readline() == "holds\n"
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_second_driver_is_refused_with_the_holder(held):
    process = held(LINE, "driver")
    with pytest.raises(BusyError) as error:
        lock_line(LINE, Role.DRIVER)
    assert error.value.where == LINE
    assert f"process {process.pid}" in error.value.what
    assert error.value.holder_pid == process.pid
    assert holder_of(LINE) == (Role.DRIVER, process.pid)


def test_the_kernel_releases_the_lock_of_a_killed_process(held):
    process = held(LINE, "driver")
    process.send_signal(signal.SIGKILL)
    process.wait()
    lock_line(LINE, Role.GUARDIAN, 0.0).release()


def test_killed_driver_that_nobody_has_waited_for_does_not_count_as_a_driver(held):
    process = held(LINE, "driver")
    file = locks._file(LINE)
    process.kill()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and stays in the table of processes
    with file.open() as shared:  # a guardian still has the lock
        fcntl.flock(shared, fcntl.LOCK_EX)
        waiting = threading.Timer(0.3, fcntl.flock, (shared, fcntl.LOCK_UN))
        waiting.start()
        lock_line(LINE, Role.OFF, 30.0).release()
        waiting.join()


def test_a_guardian_at_work_is_awaited(held):
    process = held(LINE, "guardian")
    with pytest.raises(BusyError, match="guardian") as error:
        lock_line(LINE, Role.DRIVER, 0.1)
    assert f"process {process.pid}" in error.value.what
    process.kill()
    process.wait()
    with lock_line(LINE, Role.DRIVER):
        assert holder_of(LINE) == (Role.DRIVER, os.getpid())


def test_process_that_released_the_line_is_not_named_as_its_holder():
    lock_line(LINE, Role.DRIVER, 0.0).release()
    assert holder_of(LINE) is None


def test_driver_that_releases_the_line_leaves_the_name_of_its_guardian():
    lock = lock_line(LINE, Role.DRIVER, 0.0)
    lock.hold_as(Role.GUARDIAN, 1)
    lock.release()
    assert holder_of(LINE) == (Role.GUARDIAN, 1)


def test_guardian_keeps_the_line_that_its_driver_releases():
    lock = lock_line(LINE, Role.DRIVER, 0.0)
    guardian = subprocess.Popen(
        [sys.executable, "-c", INHERITS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=(lock.descriptor,),
    )
    assert guardian.stdout.readline() == "holds\n"
    lock.hold_as(Role.GUARDIAN, guardian.pid)
    lock.release()
    with pytest.raises(BusyError):
        lock_line(LINE, Role.DRIVER, 0.0)
    guardian.communicate()
    lock_line(LINE, Role.DRIVER, 0.0).release()


def test_other_lines_and_other_units_of_a_network_are_free():
    profile = load_profile("riden-rd60xx")
    urls = [f"tcp://10.0.0.5:502{query}" for query in ("", "?")]
    lines = [line for unit in (1, 2) for url in urls for line in lines_of(key_at(url, profile, unit))]
    assert len(set(lines)) == 2
    with (
        lock_line(LINE, Role.DRIVER, 0.0),
        lock_line(lines[0], Role.DRIVER, 0.0),
        lock_line(lines[2], Role.DRIVER, 0.0),
    ):
        pass


@pytest.mark.parametrize("url", [LINE, "rtu+tcp://10.0.0.5:502"])
def test_all_units_of_a_serial_port_share_its_line(url):
    profile = load_profile("riden-rd60xx")
    assert {lines_of(key_at(url, profile, unit)) for unit in (None, 2)} == {(url.removeprefix("rtu+"),)}


def test_unwritable_folder_does_not_prevent_access(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    with lock_line(LINE, Role.DRIVER, 0.0), lock_line(LINE, Role.GUARDIAN, 0.0):
        pass


def test_pipe_in_place_of_a_lock_file_names_no_holder():
    with lock_line(LINE, Role.DRIVER, 0.0):
        file = next((locks.state_dir() / "locks").iterdir())
    file.unlink()
    os.mkfifo(file)
    assert holder_of(LINE) is None


def test_driver_that_starts_while_off_switches_off_is_rejected(held):
    process = held(LINE, "off")
    with pytest.raises(BusyError) as error:
        lock_line(LINE, Role.DRIVER, 600.0)
    assert f"process {process.pid}" in error.value.what
