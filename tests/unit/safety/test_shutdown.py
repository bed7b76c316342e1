"""The end of a run: the safe state is always written and its outcome known; signals change neither."""

import signal
from functools import partial

import pytest
from signal_injection import InterruptedLine

from smadrive import interrupts
from smadrive.errors import ConfigError, DeadlineError, TripError
from smadrive.interrupts import ABORTS_AT, SIGNALS, AbortedError, HeldSignals
from smadrive.safety.shutdown import UNCONFIRMED, ends_safe, shut_down, shutdown_of


class Device:
    """A device that counts the tries to switch it off; the first `failures` tries raise `failure`."""

    def __init__(self, failures=0, failure=None, signals=()):
        self.tries = 0
        self._failures = failures
        self._failure = failure
        self._signals = signals

    def enter_safe_state(self):
        self.tries += 1
        for number in self._signals:
            signal.raise_signal(number)
        if self.tries <= self._failures:
            raise self._failure


def notes(error):
    return getattr(error, "__notes__", [])


@pytest.mark.parametrize("kind", [TripError, OSError, BrokenPipeError, MemoryError, KeyboardInterrupt, SystemExit])
def test_any_error_carries_the_outcome_and_is_raised_again(kind):
    device, error = Device(), TripError("trip", 3) if kind is TripError else kind()
    with pytest.raises(kind) as caught, ends_safe(device.enter_safe_state):
        raise error
    assert caught.value is error
    assert device.tries == 1
    assert shutdown_of(error).confirmed
    assert notes(error) == []


@pytest.mark.parametrize("failure", [DeadlineError("no reply"), OSError(), MemoryError(), ValueError(), SystemExit()])
def test_failure_of_any_type_is_the_outcome_and_does_not_replace_the_error(failure):
    device, error = Device(99, failure), TripError("trip", 3)
    with pytest.raises(TripError), ends_safe(device.enter_safe_state):
        raise error
    assert shutdown_of(error).failure is failure
    assert [UNCONFIRMED in note for note in notes(error)] == [True]


def test_unrelated_note_is_kept():
    error = TripError("trip", 3)
    error.add_note("the trip is not remembered by the next start")
    with pytest.raises(TripError), ends_safe(Device().enter_safe_state):
        raise error
    assert shutdown_of(error).confirmed
    assert len(notes(error)) == 1


def test_last_try_counts_in_nested_blocks():
    device, error = Device(1, DeadlineError("no reply")), TripError("trip", 3)
    with pytest.raises(TripError), ends_safe(device.enter_safe_state), ends_safe(device.enter_safe_state):
        raise error
    assert device.tries == 2
    assert shutdown_of(error).confirmed
    assert notes(error) == []


def test_outer_block_knows_that_a_run_ended():
    error, device = TripError("trip", 3), Device()
    with (
        pytest.raises(TripError),
        ends_safe(device.enter_safe_state),
        ends_safe(device.enter_safe_state, is_run=True),
    ):
        raise error
    assert shutdown_of(error).ended_run


def test_failure_without_another_error_is_raised_with_the_outcome():
    with pytest.raises(DeadlineError) as caught, ends_safe(Device(99, DeadlineError("no reply")).enter_safe_state):
        pass
    assert not shutdown_of(caught.value).confirmed


@pytest.mark.parametrize(("failure", "asks"), [(DeadlineError("no reply"), True), (ConfigError("no such file"), False)])
def test_note_asks_for_the_device_only_if_it_was_asked(failure, asks):
    device = Device(99, failure)
    with pytest.raises(type(failure)), ends_safe(device.enter_safe_state):
        pass
    (note,) = notes(failure)
    assert note.startswith(UNCONFIRMED)
    assert ("the device" in note) == asks


@pytest.mark.parametrize("number", SIGNALS)
def test_first_signals_during_switching_off_are_counted_and_not_obeyed(number):
    device = Device(signals=[number] * (ABORTS_AT - 1))
    outcome = shut_down(device.enter_safe_state)
    assert outcome.confirmed
    assert outcome.signals == (number,) * (ABORTS_AT - 1)


def test_signal_does_not_replace_the_error_that_ended_the_run():
    error = TripError("trip", 3)
    with pytest.raises(TripError), ends_safe(Device(signals=[signal.SIGINT]).enter_safe_state):
        raise error
    assert shutdown_of(error).signals == (signal.SIGINT,)


def test_signal_is_obeyed_after_switching_off_without_another_error():
    with pytest.raises(KeyboardInterrupt) as caught, ends_safe(Device(signals=[signal.SIGINT]).enter_safe_state):
        pass
    assert shutdown_of(caught.value).confirmed


def test_third_signal_ends_the_tries_of_all_blocks():
    device, error = Device(signals=[signal.SIGINT] * ABORTS_AT), TripError("trip", 3)
    with pytest.raises(TripError), ends_safe(device.enter_safe_state), ends_safe(device.enter_safe_state):
        raise error
    assert device.tries == 1
    assert shutdown_of(error).aborted
    assert not shutdown_of(error).confirmed


def test_signals_of_nested_blocks_add_up():
    error, device = TripError("trip", 3), Device(signals=[signal.SIGINT])
    blocks = [ends_safe(device.enter_safe_state) for _ in range(ABORTS_AT + 1)]
    with pytest.raises(TripError), blocks[0], blocks[1], blocks[2], blocks[3]:
        raise error
    assert device.tries == ABORTS_AT
    assert shutdown_of(error).signals == (signal.SIGINT,) * ABORTS_AT
    assert shutdown_of(error).aborted


def test_third_signal_ends_the_block_although_the_handler_does_not_raise():
    before = signal.signal(signal.SIGTERM, lambda _number, _frame: None)
    try:
        with pytest.raises(AbortedError), HeldSignals():
            Device(signals=[signal.SIGTERM] * ABORTS_AT).enter_safe_state()
    finally:
        signal.signal(signal.SIGTERM, before)


def test_handlers_are_restored():
    before = [signal.getsignal(number) for number in SIGNALS]
    with HeldSignals():
        assert [signal.getsignal(number) for number in SIGNALS] != before
    assert [signal.getsignal(number) for number in SIGNALS] == before


def test_signal_at_any_line_of_the_block_leaves_the_handlers():
    def interrupt(_number, _frame):
        raise KeyboardInterrupt

    usual = signal.signal(signal.SIGTERM, interrupt)
    before = [signal.getsignal(number) for number in SIGNALS]
    try:
        at, reached = 0, True
        while reached:
            line = InterruptedLine(at, interrupts, interrupt=partial(signal.raise_signal, signal.SIGTERM))
            with line, HeldSignals():
                pass
            assert [signal.getsignal(number) for number in SIGNALS] == before
            at, reached = at + 1, line.reached
        assert at > len(SIGNALS)
    finally:
        signal.signal(signal.SIGTERM, usual)


@pytest.mark.parametrize("number", SIGNALS)
def test_no_handler_is_lost_if_another_thread_takes_a_signal(number):
    """The mask of the main thread does not stop such a signal: its handler runs between any two lines."""

    def interrupt(_number, _frame):
        raise KeyboardInterrupt

    usual = {one: signal.signal(one, interrupt) for one in SIGNALS}
    try:
        at, reached = 0, True
        while reached:
            line = InterruptedLine(at, interrupts, interrupt=lambda: signal.getsignal(number)(number, None))
            with line, HeldSignals():
                pass
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)  # a mask that stays does not stop the other thread
            for one in SIGNALS:
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(one)
            at, reached = at + 1, line.reached
        assert at > len(SIGNALS)
    finally:
        for one, handler in usual.items():
            signal.signal(one, handler)


def test_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with HeldSignals() as held:
            signal.raise_signal(signal.SIGHUP)
        assert held.received == []
    finally:
        signal.signal(signal.SIGHUP, before)
