"""An exception that ends the wait of a script for a run ends the run, and only then reaches the script."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import programs
import pytest
from marks import exhaustive

import smadrive
from smadrive.control.controllers.step import ManualStep
from smadrive.errors import ConfigError
from smadrive.runs.log.reader import read_log
from smadrive.safety.shutdown import shutdown_of
from smadrive.scripting.loop.messages import HeatRequest

LONG_S = 2_000.0
"""Virtual time of a step that takes far longer than the tests need to interrupt it."""


def exits(_number, _frame):
    sys.exit(3)


def times_out(_number, _frame):
    raise TimeoutError


@contextlib.contextmanager
def handled(handlers):
    """Give signals these handlers in the `with` block; after it, check that the block has left the handlers alone."""
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
        assert {number: signal.getsignal(number) for number in handlers} == handlers
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def signalled(log_file, *numbers):
    """Send signals to this process when the run that is recorded in `log_file` has begun."""

    def send():
        while not log_file.exists():
            time.sleep(0.01)
        for number in numbers:
            os.kill(os.getpid(), number)

    sender = threading.Thread(target=send)
    sender.start()
    yield
    sender.join()


def assert_interrupted(log_file, error):
    log = read_log(log_file)
    assert log.end_time
    assert log.ended_by.startswith("interruption")
    assert shutdown_of(error).confirmed


@pytest.mark.parametrize(
    ("handlers", "kind"),
    [
        exhaustive({signal.SIGALRM: times_out}, TimeoutError),
        exhaustive({signal.SIGTERM: exits}, SystemExit),
        ({signal.SIGALRM: times_out, signal.SIGTERM: exits}, SystemExit),
        ({signal.SIGINT: signal.default_int_handler, signal.SIGALRM: times_out}, KeyboardInterrupt),
    ],
    ids=["timeout", "exit", "timeout and exit", "interruption and timeout"],
)
def test_run_has_ended_when_the_exception_of_a_signal_handler_is_raised(rig, tmp_path, handlers, kind):
    log_file = tmp_path / "heat.h5"
    with handled(handlers), pytest.raises(kind) as raised, signalled(log_file, *handlers):
        rig.heat(LONG_S, current_a=0.1, log=log_file)
    assert_interrupted(log_file, raised.value)
    assert not rig.measure().armed
    assert rig.heat(1.0, current_a=0.1, log=tmp_path / "next.h5").trips == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("use", [lambda rig: rig.off(), lambda rig: rig.close()], ids=["off", "close"])
def test_handler_that_uses_the_rig_during_a_run_gets_an_error_and_ends_the_run(tmp_path, use):
    log_file = tmp_path / "heat.h5"
    with smadrive.open_rig("in-process") as rig:
        with (
            handled({signal.SIGUSR1: lambda _number, _frame: use(rig)}),
            pytest.raises(ConfigError) as refused,
            signalled(log_file, signal.SIGUSR1),
        ):
            rig.heat(LONG_S, current_a=0.1, log=log_file)
        assert refused.value.where == "loop process"
        assert refused.value.cure
        assert read_log(log_file).ended_by.startswith("interruption")


def test_run_has_ended_when_the_error_of_its_display_is_raised(rig, tmp_path):
    def fail(_progress):
        raise ZeroDivisionError

    log_file = tmp_path / "heat.h5"
    with pytest.raises(ZeroDivisionError) as raised:
        rig._client.call(HeatRequest(log_file, ManualStep(0.1, None, LONG_S)), fail)
    assert_interrupted(log_file, raised.value)
    assert not rig.measure().armed


@pytest.mark.exhaustive
def test_handler_that_raises_nothing_does_not_end_the_run(rig, tmp_path):
    called, log_file = [], tmp_path / "heat.h5"
    with handled({signal.SIGUSR1: lambda *given: called.append(given)}), signalled(log_file, signal.SIGUSR1):
        run = rig.heat(200.0, current_a=0.1, log=log_file)
    assert (len(called), run.log.ended_by) == (1, "")


ENDS_BY_A_HANDLER = """
import signal, sys
import smadrive
signal.signal(signal.SIGTERM, lambda *_: sys.exit(3))
with smadrive.open_rig("in-process") as rig:
    print(rig._client.child.pid, flush=True)
    rig.heat(float(sys.argv[1]), current_a=0.1, log="heat.h5")
"""


@pytest.mark.exhaustive
def test_terminated_script_with_a_handler_ends_its_run(tmp_path):
    command = [sys.executable, "-c", ENDS_BY_A_HANDLER, str(LONG_S)]
    with programs.Program(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as script:
        loop = int(script.stdout.readline())
        while not Path(tmp_path / "heat.h5").exists():
            time.sleep(0.01)
        script.send_signal(signal.SIGTERM)
        _, errors = script.communicate()
    assert (script.returncode, errors) == (3, "")
    assert not programs.lives(loop)
    assert read_log(tmp_path / "heat.h5").ended_by.startswith("interruption")
