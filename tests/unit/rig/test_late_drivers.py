"""A driver that starts while `off` works is stopped too, and the heater is switched off once more after it."""

import os
import signal
import subprocess
import sys

import programs
import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError, SafetyError
from smadrive.rig.config import DeviceConfig
from smadrive.rig.connections import key_of
from smadrive.rig.planned_device import PlannedDevice
from smadrive.rig.switching_off.drivers import MOST_LATE, stop_drivers, stop_late_drivers
from smadrive.rig.switching_off.each import each

DRIVER = """
import sys, time
from smadrive.devices.stopping.listener import StopListener
with StopListener('driver') as listener:
    listener.listen(sys.argv[1], sys.argv[1:])
    print("listens", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def port():
    descriptors = os.openpty()
    yield os.ttyname(descriptors[1])
    for descriptor in descriptors:
        os.close(descriptor)


@pytest.fixture
def start(port):
    """`start()`: a driver of the port begins to listen, at the name of the port or at other names."""
    processes = []

    def begin(*names):
        command = [sys.executable, "-c", DRIVER, *(names or (f"serial://{port}",))]
        processes.append(programs.Program(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True))
        assert processes[-1].stdout.readline() == "listens\n"
        return processes[-1].pid

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def keys(port):
    config = DeviceConfig(name="board", profile="sma-reference", url=f"serial://{port}")
    return [key_of(PlannedDevice(config, load_profile("sma-reference")))]


def test_no_driver_needs_no_second_confirmation(keys):
    confirmed = []
    assert stop_late_drivers(keys, lambda: confirmed.append(1)) == ((), None, None)
    assert not confirmed


def test_heater_is_confirmed_off_again_after_each_driver_that_came(keys, start):
    pids, confirmed = [start()], []

    def confirm():
        confirmed.append(1)
        if len(confirmed) == 1:
            pids.append(start())

    stopped, refused, failure = stop_late_drivers(keys, confirm)
    assert [driver.pid for driver in stopped] == pids
    assert len(confirmed) == 2
    assert (refused, failure) == (None, None)


def test_failed_second_confirmation_is_returned_and_confirms_the_other_sources(keys, start):
    pid, confirmed = start(), []

    def fail():
        raise DeadlineError("no reply")

    sources = [fail, lambda: confirmed.append("second")]
    stopped, refused, failure = stop_late_drivers(keys, lambda: each(sources, lambda confirm: confirm())[1])
    assert [driver.pid for driver in stopped] == [pid]
    assert refused is None
    assert isinstance(failure, DeadlineError)
    assert confirmed == ["second"]


def test_drivers_that_start_again_and_again_are_returned_with_an_error(keys, start):
    pids = [start()]

    def confirm():
        pids.append(start())

    stopped, refused, failure = stop_late_drivers(keys, confirm)
    assert [driver.pid for driver in stopped] == pids[:MOST_LATE]
    assert refused is None
    assert isinstance(failure, SafetyError)
    assert failure.limit == MOST_LATE


def test_driver_of_an_ended_terminal_keeps_no_number_from_a_new_one(keys, start):
    """The number of a pseudo-terminal is soon reused. Both drivers listen, and both are stopped."""
    pids = [start(), start()]
    stopped, _ = stop_drivers(keys)
    assert [driver.pid for driver in stopped] == pids


@pytest.mark.exhaustive
def test_driver_with_several_names_is_killed_once(keys, start, port, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(port)
    by_link = DeviceConfig(name="other", profile="sma-reference", url=f"serial://{link}")
    pid = start(f"serial://{port}", f"serial://{link}")
    os.kill(pid, signal.SIGSTOP)
    stopped, failure = stop_drivers([*keys, key_of(PlannedDevice(by_link, load_profile("sma-reference")))])
    assert [(driver.pid, driver.killed) for driver in stopped] == [(pid, True)]
    assert failure is None
