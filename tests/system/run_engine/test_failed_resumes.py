"""A resume that fails or is interrupted leaves the run engine paused, and then no wire is heated."""

import signal
import threading
import time

import pytest
from bluesky import plan_stubs as bps
from bluesky.utils import RunEngineInterrupted

from smadrive.errors import MotionError

from .conftest import is_off

pytestmark = pytest.mark.exhaustive

ENDS_WITHIN_S = 30.0


@pytest.fixture
def engine(engine):
    yield engine
    if engine.state == "paused":
        engine.abort()


@pytest.fixture
def interruptible():
    """A Ctrl-C raises KeyboardInterrupt, also in a process that was started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def pause(engine, *wires):
    """Pause a plan that has moved the wires to 6 mm. After the resume it checks that they are there."""

    def plan():
        for wire in wires:
            yield from bps.mv(wire, 6.0)
        yield from bps.checkpoint()
        yield from bps.pause()
        for wire in wires:
            assert wire.locate() == {"setpoint": 6.0, "readback": pytest.approx(6.0, abs=0.2)}

    with pytest.raises(RunEngineInterrupted):
        engine(plan())


def interrupt_when_heated(wire):
    """Press Ctrl-C when the next servo of the wire has begun."""
    before = wire._servo

    def interrupt():
        while wire._servo is before or wire._servo.tick is None:
            time.sleep(0.01)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()


def goes_off(wire):
    """Wait for the end of the servo, and return whether the heater is off."""
    wire._servo._thread.join(ENDS_WITHIN_S)
    return is_off(wire._rig, wire)


def test_interrupted_resume_switches_off_and_can_be_repeated(engine, interruptible, wire):
    pause(engine, wire)
    wire.configure(tolerance_mm=1e-6, timeout_s=1e6)
    interrupt_when_heated(wire)
    with pytest.raises(KeyboardInterrupt):
        engine.resume()
    assert engine.state == "paused"
    assert goes_off(wire)
    wire.configure(tolerance_mm=0.2, timeout_s=30.0)
    engine.resume()
    assert goes_off(wire)


def test_failed_resume_of_one_wire_switches_off_all(engine, wire, other_wire):
    pause(engine, wire, other_wire)
    first, last = (one for one in engine._objs_seen if one in {wire, other_wire})
    last.configure(tolerance_mm=1e-6, timeout_s=0.5)
    with pytest.raises(MotionError):
        engine.resume()
    assert engine.state == "paused"
    assert goes_off(last)
    assert goes_off(first)
    last.configure(tolerance_mm=0.2, timeout_s=30.0)
    engine.resume()
    assert goes_off(first)
    assert goes_off(last)
