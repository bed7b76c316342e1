"""The handler of the signals that end a command: a signal counts unless an earlier one is unwinding the program."""

import signal
import sys
import weakref
from contextlib import contextmanager

import pytest

from smadrive.cli import INTERRUPTED, _interrupt
from smadrive.errors import TransportError
from smadrive.interrupts import HeldSignals


@pytest.fixture(autouse=True)
def _handled():
    before = signal.signal(signal.SIGINT, _interrupt)
    yield
    signal.signal(signal.SIGINT, before)


def press():
    signal.raise_signal(signal.SIGINT)


def test_signal_counts_after_python_swallowed_an_earlier_one(monkeypatch):
    swallowed = []
    monkeypatch.setattr(sys, "unraisablehook", lambda report: swallowed.append(report.exc_type))
    thing = {1}
    reference = weakref.ref(thing, lambda _: press())
    del thing
    assert reference() is None
    assert swallowed == [SystemExit]
    with pytest.raises(SystemExit) as ended:
        press()
    assert ended.value.code == INTERRUPTED


def fail():
    raise TransportError("the port is gone")


@contextmanager
def then(action):
    """Call `action` at the end of the `with` block, while an error of the block unwinds."""
    try:
        yield
    finally:
        action()


class Log:
    """A log whose writing is disturbed by signals, also by one during the handling of another error."""

    is_written = False

    def write(self):
        press()
        try:
            fail()
        except TransportError:
            press()
        self.is_written = True


def test_signal_is_ignored_while_an_earlier_one_unwinds():
    log = Log()
    with pytest.raises(SystemExit) as ended, then(log.write):
        press()
    assert ended.value.code == INTERRUPTED
    assert log.is_written


def test_signal_is_ignored_while_an_error_replaces_the_earlier_interruption():
    log = Log()
    with pytest.raises(TransportError), then(log.write), then(fail):
        press()
    assert log.is_written


def test_signal_counts_while_another_error_unwinds():
    with pytest.raises(SystemExit), then(press):
        fail()


def test_signal_is_held_while_the_heater_is_switched_off():
    held = HeldSignals()

    def switch_off():
        with held:
            press()

    with pytest.raises(SystemExit), then(switch_off):
        press()
    assert held.received == [signal.SIGINT]
