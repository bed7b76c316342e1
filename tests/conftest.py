"""For all tests: no time limit on hypothesis' examples, since how fast a machine is says nothing of the code; a folder
for state that no other test and no user shares; and signals as at a terminal, for what runs in the background, or under
nohup, ignores some, and so would every program that a test starts and interrupts.
"""

import signal

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
