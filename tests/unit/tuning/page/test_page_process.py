"""The page process ends with its input."""

import json
import subprocess
import sys

import pytest

PATIENCE_S = 60.0


@pytest.mark.exhaustive
def test_page_process_ends_while_it_waits_for_a_status(driver_end, tmp_path):
    """Nothing has been published on this channel."""
    fds = driver_end.memory_fd, driver_end.page_socket.fileno()
    parameters = {"memory_fd": fds[0], "socket_fd": fds[1], "token": "", "folder": "", "rig_file": "", "port": 0}
    page = subprocess.Popen(
        [sys.executable, "-m", "smadrive.tuning.page.process"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        pass_fds=fds,
    )
    assert page.communicate(
        json.dumps({**parameters, "path": str(tmp_path / "page")}).encode() + b"\n", PATIENCE_S
    ) == (
        b"",
        b"",
    )
    assert page.returncode == 0
