"""For all tests: no time limit on hypothesis' examples, since how fast a machine is says nothing of the code; and a
folder for state that no other test and no user shares.
"""

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(autouse=True)
def state_home(tmp_path_factory, monkeypatch):
    """Where this test, and what it starts, keeps state."""
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder
