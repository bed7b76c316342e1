"""The process of a script: stopped for long, or not."""

import os
import signal
import subprocess
import sys

import pytest

from smadrive.scripting.loop.script_process import STOPPED_S, ScriptProcess

only_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows the state of a process")


@pytest.fixture
def stopped():
    """A process that is stopped, as its loop process sees it."""
    with subprocess.Popen(["sleep", "600"]) as process:
        script = ScriptProcess(process.pid)
        assert not script.is_stopped(0.0)
        assert not script.is_stopped(100.0)
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        yield process, script
        process.kill()


@only_linux
def test_only_a_process_that_stays_stopped_counts_as_stopped(stopped):
    process, script = stopped
    assert [script.is_stopped(200.0 + after_s) for after_s in (0.0, STOPPED_S, STOPPED_S + 1.0)] == [False, False, True]
    process.send_signal(signal.SIGCONT)
    os.waitid(os.P_PID, process.pid, os.WCONTINUED)
    assert not script.is_stopped(300.0)


@only_linux
def test_two_short_stops_are_no_long_one(stopped):
    """The script has sent messages between the two, so that nobody has looked at it."""
    _, script = stopped
    assert not script.is_stopped(200.0)
    script.has_run()
    assert not script.is_stopped(260.0)
    assert script.is_stopped(260.0 + STOPPED_S + 1.0)


def test_process_that_nobody_knows_is_not_stopped():
    script = ScriptProcess(2**30)
    assert not script.is_stopped(0.0)
    assert not script.is_stopped(100.0)
