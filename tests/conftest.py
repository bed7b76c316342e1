"""For all tests: worker processes, state folders, signals, and guardian processes that outlive a run.

numpy uses one thread, as in the commands of smadrive: for small matrices its threads would only wait for each other.

Hypothesis has no time limit, because the speed of a machine says nothing about the code. Every test gets a state folder
of its own. Signals are set as at a terminal: a process in the background or under nohup ignores some of them, and so
would every program that a test starts and interrupts. A run that leaves a guardian process behind fails, because that
process would go on looking for its device and find the device of a later run.
"""

import asyncio
import contextlib
import fcntl
import gc
import os
import signal
import tempfile
import time
import uuid
from collections import Counter
from pathlib import Path

import programs
import pytest
from hypothesis import settings
from process_tree import is_guardian
from xdist.scheduler import LoadFileScheduling

from smadrive.numerics.blas_threads import ONE_THREAD

os.environ |= ONE_THREAD

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


WORKERS_A_CORE = 2.5
"""Many tests wait in real time, so a core serves several workers. More would cost more: each collects all tests."""

BROWSER = "tests/browser/"
PROCESSES = "tests/system/processes/"
"""The folder whose tests wait most: each of them may run on another worker."""
SYSTEM = "tests/system/"
OTHER = ""
FOLDERS = (PROCESSES, BROWSER, SYSTEM, OTHER)
"""The folders of the tests. Those whose tests wait longest come first."""
PREFERRED = (OTHER, OTHER, SYSTEM, SYSTEM, PROCESSES)
"""The folder that each fifth of the workers prefers. So some tests compute while others wait, from start to end."""


def pytest_xdist_auto_num_workers(config):
    """`WORKERS_A_CORE` workers a core; none when only files or single tests are named."""
    if all(".py" in argument for argument in config.args):
        return 0
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else round(WORKERS_A_CORE * cores())


def cores():
    return len(os.sched_getaffinity(0))


def unit_of(nodeid):
    """The unit of tests that one worker runs: a file, or a single test of PROCESSES."""
    return nodeid if nodeid.startswith(PROCESSES) else nodeid.partition("::")[0]


def folder_of(nodeid):
    """The first of FOLDERS that contains the test or unit."""
    return next(folder for folder in FOLDERS if nodeid.startswith(folder))


class Scheduling(LoadFileScheduling):
    """Gives a unit at a time to a worker: the next one of the folder that the worker prefers, or else of any folder."""

    def _split_scope(self, nodeid):
        return unit_of(nodeid)

    def _assign_work_unit(self, node):
        folder = PREFERRED[self.nodes.index(node) * len(PREFERRED) // len(self.nodes)]
        preferred = (unit for unit in self.workqueue if folder_of(unit) == folder)
        self.workqueue.move_to_end(next(preferred, next(iter(self.workqueue))), last=False)
        super()._assign_work_unit(node)


def pytest_xdist_make_scheduler(config, log):
    return Scheduling(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests of BROWSER as exhaustive. Begin with the folders that wait longest, and there with large units.

    So no worker begins a large unit when the others are about to end.
    """
    for item in items:
        if item.nodeid.startswith(BROWSER):
            item.add_marker("exhaustive")
    sizes = Counter(unit_of(item.nodeid) for item in items)
    items.sort(key=lambda item: (FOLDERS.index(folder_of(item.nodeid)), -sizes[unit_of(item.nodeid)]))


def pytest_collection():
    """Collect no garbage while tests are collected: nearly all objects that they make are needed to the end."""
    gc.disable()


def pytest_collection_finish():
    """Exclude the collected tests and all imports from garbage collection, which would visit them again and again."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def state_home(tmp_path_factory, monkeypatch):
    """Where this test, and what it starts, keeps state."""
    base = tmp_path_factory.getbasetemp() / "state"
    base.mkdir(exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=base))  # numbered folders, as of `mktemp`, cost the more the more there are
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.fixture(scope="session")
def once_per_run(tmp_path_factory, worker_id):
    """`once_per_run(name, make)` is a folder that `make(folder)` filled once, shared by all workers of this run."""
    base = tmp_path_factory.getbasetemp()
    shared = base if worker_id == "master" else base.parent

    def folder_of(name, make):
        folder, done = shared / name, shared / f"{name}.done"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return folder_of


@pytest.fixture(autouse=True, scope="session")
def _server_of_programs_ends():
    yield
    programs.end_server()


@pytest.fixture(autouse=True, scope="module")
def _no_event_loop_is_left():
    """Fail when a module leaves an event loop running in the main thread: no later test could run one of its own."""
    yield
    assert asyncio._get_running_loop() is None


RUN = "SMADRIVE_TEST_RUN"
ENDS_WITHIN_S = 60.0
"""A guardian that sees that its pseudo-terminal is gone has ended after this time, on a busy machine too."""


def guardians_of(run):
    """The guardian processes that were started by this run, or by a program that it started."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has just ended, or is another user's
            environment = (process / "environ").read_bytes().split(b"\0")
            if f"{RUN}={run}".encode() in environment and is_guardian(process.name):
                found.append(int(process.name))
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
