"""Campaigns of short tracking runs, as a user starts them."""

import json
import socket
import subprocess
import sys
import time
from contextlib import suppress

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

WORKERS_END_WITHIN_S = 30.0
"""A worker whose command was killed may need this time to notice, s."""

COMMAND = (sys.executable, "-m", "smadrive")
WORKER = "multiprocessing.spawn"


class Campaign:
    """A campaign file in a folder, and commands that execute it. `workers` are the workers that were seen so far."""

    def __init__(self, folder, wires):
        self.folder, self.runs, self.workers = folder, 2 * wires, set()
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
        """Return the workers of a command that runs on this machine: at least one."""
        found = workers_below(process.pid)
        self.workers |= set(found)
        assert found
        return found

    def table(self, output):
        import pandas as pd  # here, because every test process imports this file

        return pd.read_parquet(self.folder / output / "results.parquet")


def workers_below(pid):
    """Return the workers that the process `pid` has started, directly or not."""
    found = []
    for child in psutil.Process(pid).children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            if WORKER in str(child.cmdline()):
                found.append(child)
    return found


def left_of(workers):
    """Wait until the workers have ended, and kill those that have not. Return these."""
    waited = psutil.wait_procs(workers, timeout=WORKERS_END_WITHIN_S)[1]
    left = [worker for worker in waited if is_alive(worker)]
    for worker in left:
        worker.kill()
    return left


def is_alive(process):
    """Return True unless the process has ended. In a container, its entry may stay if process 1 reaps no orphan."""
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.fixture
def campaign(tmp_path):
    """A campaign of 20 runs. At the end of the test, no worker that it has seen may be left."""
    exact_wire().save(tmp_path / "wire.json")
    campaign = Campaign(tmp_path, wires=10)
    yield campaign
    assert left_of(campaign.workers) == []


@pytest.fixture
def free_port():
    """`free_port()` is a port on 127.0.0.1 that nobody uses."""

    def port():
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            return one.getsockname()[1]

    return port
