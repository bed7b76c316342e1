"""The process of a script: stopped for long, or not."""

import signal
import sys
import time

import programs
import pytest

from smadrive.scripting.loop.script_process import STOPPED_S, ScriptProcess


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows the state of a process")
def test_only_a_process_that_stays_stopped_counts_as_stopped():
    with programs.Program([sys.executable, "-c", "input()"], stdin=-1) as program:
        script = ScriptProcess(program.pid)
        assert not script.is_stopped(0.0)
        assert not script.is_stopped(100.0)
        program.send_signal(signal.SIGSTOP)
        now_s = 200.0
        while not script.is_stopped(now_s):
            now_s += 1.0
            time.sleep(0.01)
        assert now_s > 200.0 + STOPPED_S
        program.send_signal(signal.SIGCONT)
        while script.is_stopped(300.0):
            time.sleep(0.01)
        assert not script.is_stopped(400.0)


def test_process_that_nobody_knows_is_not_stopped():
    script = ScriptProcess(2**30)
    assert not script.is_stopped(0.0)
    assert not script.is_stopped(100.0)
