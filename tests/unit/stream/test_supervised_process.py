"""A supervised process is restarted until a restart succeeds, and always ends with the session."""

import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from marks import exhaustive
from process_tree import children

from smadrive.errors import ConfigError
from smadrive.stream.supervised_process import SupervisedProcess
from smadrive.tuning.processes import BuilderProcess

MODULES = [
    "smadrive.tuning.front.process",
    "smadrive.tuning.page.process",
    "smadrive.tuning.builder.process",
    "smadrive.telemetry.process",
]
PATIENCE_S = 60.0


class Interrupted(BaseException):
    """The exception that a signal handler raises, as Ctrl-C does in a command."""


def wait(condition):
    """Wait until `condition()` holds; fails after PATIENCE_S."""
    give_up_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < give_up_s
        time.sleep(0.01)


@contextmanager
def no_descriptors():
    """No file can be opened inside this context."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (5, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.exhaustive
def test_process_starts_again_after_its_restart_has_failed():
    with BuilderProcess() as builder:
        with no_descriptors():
            os.kill(builder.pid, signal.SIGKILL)
            wait(lambda: builder.trouble)
            assert builder.restarts == 0
        wait(lambda: builder.restarts)
        assert builder.trouble is None
        os.kill(builder.pid, 0)


@pytest.fixture
def slow_module(tmp_path, monkeypatch):
    """The name of a module that never becomes ready."""
    (tmp_path / "slow_to_start.py").write_text("import time\nwhile True:\n    time.sleep(1.0)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    return "slow_to_start"


def test_interrupt_during_the_start_leaves_no_process(slow_module):
    def interrupt(*_):
        raise Interrupted

    before = set(children(os.getpid()))
    handler = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    try:
        with pytest.raises(Interrupted), SupervisedProcess(slow_module, {}, (), extra="tune"):
            pass
    finally:
        signal.signal(signal.SIGALRM, handler)
    assert set(children(os.getpid())) == before


def test_end_during_a_new_start_leaves_no_process(tmp_path, monkeypatch):
    """The first start of the process succeeds; a restart never becomes ready."""
    script = "import pathlib, sys, time\nonce = pathlib.Path(sys.argv[0]).with_suffix('.once')\n"
    script += "if not once.exists():\n    once.touch()\n    print('{}', flush=True)\n"
    (tmp_path / "ready_once.py").write_text(f"{script}while True:\n    time.sleep(1.0)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with SupervisedProcess("ready_once", {}, (), extra="tune") as process:
        first = process.pid
        os.kill(first, signal.SIGKILL)
        wait(lambda: process.pid != first)
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)


@pytest.mark.parametrize("module", [*map(exhaustive, MODULES[:-1]), MODULES[-1]])
def test_process_ends_quietly_when_its_input_ends_before_it_serves(module):
    ended = subprocess.run([sys.executable, "-m", module], stdin=subprocess.DEVNULL, capture_output=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b"", b"")


def test_error_of_a_child_that_does_not_start_names_its_extra(tmp_path, monkeypatch):
    (tmp_path / "lacks_a_package.py").write_text("import sys\nsys.exit(1)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(ConfigError) as raised, SupervisedProcess("lacks_a_package", {}, (), extra="mqtt"):
        pass
    assert raised.value.where == "lacks_a_package"
    assert "smadrive[mqtt]" in raised.value.cure
