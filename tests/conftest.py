"""For all tests: no time limit on hypothesis' examples, since how fast a machine is says nothing of the code; a folder
for state that no other test and no user shares; and signals as at a terminal, for what runs in the background, or under
nohup, ignores some, and so would every program that a test starts and interrupts. A run that leaves a guardian behind
fails: it would go on looking for a device that is gone, and find that of a later run.
"""

import os
import signal
import time
import uuid
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True)
def state_home(tmp_path_factory, monkeypatch):
    """Where this test, and what it starts, keeps state."""
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


RUN = "SMADRIVE_TEST_RUN"
ENDS_WITHIN_S = 10.0
"""A guardian that sees that its pseudo-terminal is gone has ended after this time."""


def guardians_of(run):
    """The guardian processes that were started by this run, or by a program that it started."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if b"smadrive.devices.guardian.process" in (process / "cmdline").read_bytes() and (
                f"{RUN}={run}".encode() in (process / "environ").read_bytes().split(b"\0")
            ):
                found.append(int(process.name))
        except OSError:  # it has just ended, or is another user's
            continue
    return found


@pytest.fixture(autouse=True, scope="session")
def _no_guardian_is_left():
    """Fail when guardians of this run are left, and end them."""
    run = os.environ[RUN] = uuid.uuid4().hex
    yield
    give_up_s = time.monotonic() + ENDS_WITHIN_S
    while (left := guardians_of(run)) and time.monotonic() < give_up_s:
        time.sleep(0.1)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert not left, f"guardians are left: {left}"
