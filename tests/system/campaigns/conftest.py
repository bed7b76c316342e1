"""Campaigns of short tracking runs, as a user starts them."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress

import pandas as pd
import psutil
import pytest
from exact_wire import exact_wire

CAMPAIGN = """
title = "short runs"
seed = 7
[run]
model = "wire.json"
reference = "up"
[[vary]]
random_wires = {wires}
[[vary]]
displacement_sensor = [true, false]
[references.up]
shape = "trapezoid:rise_s=3,dwell_s=1,cycles=0.5"
smooth = false
[report]
worst_logs = 2
"""

COMMAND = (sys.executable, "-m", "smadrive")
WORKER = "multiprocessing.spawn"


class Campaign:
    """A campaign file in a folder, and commands that execute it."""

    def __init__(self, folder, wires):
        self.folder, self.runs = folder, 2 * wires
        (folder / "campaign.toml").write_text(CAMPAIGN.format(wires=wires), encoding="utf-8")

    def start(self, output, *options):
        command = (*COMMAND, "campaign", "campaign.toml", "-o", output, "--json", *options)
        return subprocess.Popen(
            command,
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def run(self, output, *options):
        """Execute the campaign, and return its JSON object."""
        done = self.start(output, *options)
        out, err = done.communicate()
        assert done.returncode == 0, err
        return json.loads(out)

    def wait_for_runs(self, process, output, count):
        """Wait until `count` runs are in the journal of the command `process`."""
        journal = self.folder / output / "journal.jsonl"
        while not journal.exists() or journal.read_bytes().count(b"\n") <= count:
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)

    def workers_of(self, process):
        """Return the process ids of the workers of a command."""
        return worker_pids(process.pid)

    def table(self, output):
        return pd.read_parquet(self.folder / output / "results.parquet")


def worker_pids(pid):
    """Return the process ids of the workers that the process `pid` has started, directly or not."""
    found = []
    for child in psutil.Process(pid).children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            if WORKER in str(child.cmdline()):
                found.append(child.pid)
    return found


@pytest.fixture
def campaign(tmp_path):
    exact_wire().save(tmp_path / "wire.json")
    return Campaign(tmp_path, wires=10)


@pytest.fixture
def free_port():
    """`free_port()` is a port on 127.0.0.1 that nobody uses."""

    def port():
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            return one.getsockname()[1]

    return port


@pytest.fixture(autouse=True)
def _no_process_is_left():
    yield
    left = worker_pids(os.getpid())
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert not left
