"""The guardian on a system that has no resources left."""

import os
import subprocess
import sys
import threading
import time

import pytest

from smadrive.devices.guardian.duty import HeldDuty
from smadrive.devices.guardian.process import DriverProcess, Guardian
from smadrive.devices.guardian.search import PortSearch
from smadrive.devices.guardian.states import AttemptOutcome, GuardianState
from smadrive.devices.guardian.switch import LineAccess, OffSwitch
from smadrive.devices.guardian.task import GuardedDevice
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at

DEVICE = GuardedDevice("riden-rd60xx", "serial:///dev/no-such-port", 1)


@pytest.fixture
def guardian():
    profile = load_profile(DEVICE.profile)
    key = key_at(DEVICE.url, profile, DEVICE.unit_id)
    access = LineAccess(())
    switch = OffSwitch(DEVICE, profile, PortSearch(DEVICE.url, key.names, time.monotonic), access)
    with HeldDuty.take("riden", key) as duty:
        yield Guardian(DriverProcess(0), switch, access, duty, 1.0)


@pytest.mark.parametrize("error", [RuntimeError("can't start new thread"), MemoryError()])
def test_message_that_cannot_be_printed_does_not_end_an_attempt(guardian, monkeypatch, error):
    def start(_thread):
        raise error

    monkeypatch.setattr(threading.Thread, "start", start)
    for state in (GuardianState.TAKING_OVER, GuardianState.WAITING_FOR_DEVICE):
        assert guardian.attempt(state) is AttemptOutcome.UNREACHABLE


STARTED = """
import os
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
task = Task(GuardedDevice("riden-rd60xx", "serial:///dev/no-such-port", 1), 1.0)
with GuardianClient(task, lambda: None) as client:
    print(os.readlink(f"/proc/{client._process.pid}/fd/2"))
"""


def test_messages_of_a_guardian_without_a_terminal_go_to_no_port():
    """The driver has no standard error, so its guardian would open its port with this descriptor."""
    script = ["sh", "-c", '"$0" -c "$1" 2>&-', sys.executable, STARTED]
    done = subprocess.run(script, stdout=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{os.devnull}\n")
