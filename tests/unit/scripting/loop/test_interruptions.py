"""The error that a request raises in the script, by its reply and by the signals that arrived meanwhile."""

import contextlib
import itertools
import signal

import pytest

from smadrive.errors import SafetyError, StoppedError, TransportError
from smadrive.interrupts import SIGNALS, HeldSignals
from smadrive.safety.shutdown import ShutdownOutcome, carry, shutdown_of
from smadrive.scripting.loop.interruptions import RequestSignals, error_to_raise
from smadrive.scripting.loop.messages import Failure, Result


def error(failed=None, count=0, kept=None):
    signals = RequestSignals()
    signals.count, signals.error = count, kept
    return error_to_raise(Result(None) if failed is None else Failure(failed, ""), signals)


def test_request_without_signals_raises_its_own_error():
    failed = TransportError("no reply")
    assert (error(), error(failed)) == (None, failed)


@pytest.mark.parametrize("failed", [None, TransportError("no reply"), SafetyError("the script was stopped")])
@pytest.mark.parametrize("kept", [None, ValueError("handler")])
def test_interruption_comes_before_an_error(failed, kept):
    """A script that tries again after errors must not heat again."""
    raised = error(failed, 1, kept)
    assert type(raised) is KeyboardInterrupt
    assert raised.__cause__ is kept
    assert getattr(raised, "__notes__", []) == ([] if failed is None else [str(failed)])


@pytest.mark.parametrize("ended", [StoppedError("stopped by `smadrive off`"), SystemExit(3)])
def test_error_that_is_no_exception_comes_before_an_interruption(ended):
    is_failure = isinstance(ended, StoppedError)
    assert error(ended if is_failure else None, 1, None if is_failure else ended) is ended


def test_outcome_of_the_shutdown_is_carried():
    failed, outcome = KeyboardInterrupt(), ShutdownOutcome(ended_run=True)
    carry(failed, outcome)
    for raised in (error(failed, 1), error(failed, 0, SafetyError("another thread"))):
        assert shutdown_of(raised) is outcome


@pytest.mark.parametrize("block", [HeldSignals, RequestSignals])
def test_handler_that_raises_while_the_mask_is_set_leaves_no_mask(block, monkeypatch):
    """Python calls waiting handlers within pthread_sigmask, after the mask is set. A script may have any handler.

    A loop process inherits the mask of its script, and could not be interrupted.
    """
    set_mask, at, reached = signal.pthread_sigmask, 0, True

    def interrupt(_number, _frame):
        raise KeyboardInterrupt

    usual = {one: signal.signal(one, interrupt) for one in SIGNALS}
    before = set_mask(signal.SIG_BLOCK, ())
    try:
        while reached:
            calls = itertools.count()

            def cut(how, numbers, calls=calls, at=at):
                mask = set_mask(how, numbers)
                if next(calls) == at:
                    raise TimeoutError
                return mask

            monkeypatch.setattr(signal, "pthread_sigmask", cut)
            with contextlib.suppress(TimeoutError), block():
                pass
            monkeypatch.undo()
            assert set_mask(signal.SIG_BLOCK, ()) == before
            for one in SIGNALS:
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(one)
            at, reached = at + 1, next(calls) > at
        assert at > 4
    finally:
        set_mask(signal.SIG_SETMASK, before)
        for one, handler in usual.items():
            signal.signal(one, handler)
