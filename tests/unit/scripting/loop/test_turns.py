"""The turns of the threads of a script, and a thread that ends the requests of the others."""

import signal
import sys
import threading
from functools import partial

import pytest
from signal_injection import InterruptedLine

from smadrive.errors import SafetyError
from smadrive.scripting.loop.client import turns as module
from smadrive.scripting.loop.client.turns import Turns
from smadrive.scripting.loop.messages import CoolDownRequest, MeasureRequest


def no_servo():
    """The rig has no servo that could be ended."""


class WaitingThread(threading.Thread):
    """A thread that wants to carry out `request`. `error` is what it gets instead of its turn, or None."""

    def __init__(self, turns, request):
        super().__init__()
        self.error, self.waits = None, threading.Event()
        self._turns, self._request = turns, request

    def run(self):
        sys.settrace(self._on_line)
        try:
            with self._turns.turn(self._request):
                pass
        except SafetyError as error:
            self.error = error

    def _on_line(self, frame, _event, _argument):
        if "offs_before" in frame.f_locals:
            self.waits.set()
        return self._on_line


@pytest.mark.parametrize(("request_", "is_refused"), [(CoolDownRequest(1.0), True), (MeasureRequest(), False)])
def test_long_request_that_waited_while_another_thread_switched_off_is_refused(request_, is_refused):
    turns = Turns(lambda _error: None)
    with turns.turn(MeasureRequest()):
        waiting = WaitingThread(turns, request_)
        waiting.start()
        waiting.waits.wait()
        with turns.others_ended(no_servo):
            pass
    waiting.join()
    assert (waiting.error is not None) == is_refused


def test_request_is_ended_by_an_off_that_is_over():
    turns = Turns(lambda _error: None)
    with turns.turn(CoolDownRequest(1.0)):
        assert not turns.is_ended
        with turns.others_ended(no_servo):
            assert turns.is_switching_off
        assert turns.is_ended
        assert not turns.is_switching_off
    with turns.turn(CoolDownRequest(1.0)):
        assert not turns.is_ended


def test_interrupted_off_ends_request_and_servo_or_has_not_begun():
    at, reached = 0, True
    while reached:
        ended, servo_ended = [], []
        turns = Turns(ended.append)
        interruption = InterruptedLine(at, module, interrupt=partial(signal.raise_signal, signal.SIGINT))
        with turns.turn(MeasureRequest()):
            with interruption, turns.others_ended(lambda ends=servo_ended: ends.append(True)):
                pass
            assert bool(ended) == bool(servo_ended) == turns.is_ended
        at, reached = at + 1, interruption.reached
    assert at > 5
