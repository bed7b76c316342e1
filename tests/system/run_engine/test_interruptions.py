"""A wire under a run engine that is paused, resumed, aborted or interrupted, or whose motions fail."""

import sys
import threading
import time
from threading import Timer

import numpy as np
import programs
import pytest
from bluesky import plan_stubs as bps
from bluesky import plans as bp
from bluesky import preprocessors as bpp
from bluesky.utils import FailedStatus, RunEngineInterrupted
from served import PATIENT, served, with_limits

import smadrive
from smadrive.bluesky import SmaWire
from smadrive.errors import ConfigError, MotionError, StoppedError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig

from .conftest import SINE, is_off

HEATED_A = 0.1


def paused_scan(wire):
    """A scan that pauses itself at its second point, with the heater on."""

    @bpp.stage_decorator([wire])
    @bpp.run_decorator()
    def plan():
        yield from bps.mv(wire, 4.0)
        yield from bps.trigger_and_read([wire])
        yield from bps.checkpoint()
        yield from bps.mv(wire, 6.0)
        yield from bps.pause() if not is_paused.pop() else bps.null()
        yield from bps.trigger_and_read([wire])

    is_paused = [True, False]
    return plan()


@pytest.mark.exhaustive
def test_pause_switches_off_and_resume_moves_again(engine, documents, rig, wire):
    with pytest.raises(RunEngineInterrupted):
        engine(paused_scan(wire))
    assert engine.state == "paused"
    assert is_off(rig, wire)
    engine.resume()
    rows = documents.events()
    np.testing.assert_allclose([row["wire_displacement_mm"] for row in rows], [4.0, 6.0], atol=0.2)
    assert documents.of("stop")[0]["exit_status"] == "success"
    assert is_off(rig, wire)


def scan_that_never_settles(wire):
    wire.configure(tolerance_mm=1e-6, timeout_s=1e6)
    return bp.scan([], wire, 6.0, 8.0, 2)


def long_flight(wire):
    wire.prepare(smadrive.sine(low_mm=3, high_mm=7, period_s=20000, cycles=1))
    return bpp.stage_wrapper(bp.fly([wire]), [wire])


def abort_while_heated(engine, wire):
    """Abort the plan that runs as soon as a tick of the wire has a current. Return the list that gets this current."""
    heated_a = []

    def abort():
        while (servo := wire._servo) is None or servo.tick is None or servo.tick.measurement.current_a < HEATED_A:
            time.sleep(0.01)
        assert engine.state == "running"
        heated_a.append(servo.tick.measurement.current_a)
        engine.abort("test")

    threading.Thread(target=abort, daemon=True).start()
    return heated_a


@pytest.mark.parametrize("plan", [scan_that_never_settles, long_flight])
def test_abort_of_a_running_plan_ends_at_zero_current(engine, documents, rig, wire, plan):
    heated_a = abort_while_heated(engine, wire)
    with pytest.raises(RunEngineInterrupted):
        engine(plan(wire))
    assert len(heated_a) == 1
    assert engine.state == "idle"
    assert documents.of("stop")[0]["exit_status"] == "abort"
    assert is_off(rig, wire)


def test_abort_of_a_paused_plan_ends_at_zero_current(engine, documents, rig, wire):
    with pytest.raises(RunEngineInterrupted):
        engine(paused_scan(wire))
    engine.abort("test")
    assert documents.of("stop")[0]["exit_status"] == "abort"
    assert is_off(rig, wire)


def test_abort_of_a_flight_ends_at_zero_current(engine, documents, rig, wire):
    @bpp.stage_decorator([wire])
    @bpp.run_decorator()
    def plan():
        yield from bps.prepare(wire, SINE, wait=True)
        yield from bps.kickoff(wire, wait=True)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        engine(plan())
    assert is_off(rig, wire)
    assert documents.of("stop")[0]["exit_status"] == "fail"


def test_flight_that_a_pause_has_ended_fails(engine, documents, rig, wire):
    @bpp.stage_decorator([wire])
    @bpp.run_decorator()
    def plan():
        yield from bps.prepare(wire, smadrive.sine(low_mm=3, high_mm=7, period_s=2000, cycles=1), wait=True)
        yield from bps.kickoff(wire, wait=True)
        yield from bps.checkpoint()
        yield from bps.pause()
        yield from bps.complete(wire, wait=True)

    with pytest.raises(RunEngineInterrupted):
        engine(plan())
    assert is_off(rig, wire)
    with pytest.raises(FailedStatus) as failed:
        engine.resume()
    assert isinstance(failed.value.args[0].exception(), MotionError)
    assert documents.of("stop")[0]["exit_status"] == "fail"
    assert is_off(rig, wire)


def test_interruption_during_a_move_ends_at_zero_current(engine, documents, rig, wire):
    """The move never settles, so the interruption comes while the wire is heated."""
    wire.configure(tolerance_mm=1e-6, timeout_s=1e6)
    Timer(0.5, engine.request_pause).start()
    with pytest.raises(RunEngineInterrupted):
        engine(bp.scan([], wire, 4.0, 8.0, 2))
    assert is_off(rig, wire)
    engine.abort()
    assert is_off(rig, wire)


def test_error_in_a_callback_does_not_keep_the_heater_on(rig, wire, monkeypatch):
    shown = []
    monkeypatch.setattr(threading, "excepthook", shown.append)
    wire.set(6.0).add_callback(lambda _motion: 1 / 0)
    wire.stop(success=False)
    assert is_off(rig, wire)
    assert [one.exc_type for one in shown] == [ZeroDivisionError]


def test_stop_switches_off_before_it_calls_back(rig, wire):
    running = []

    def wait_for_the_end(_motion):
        wire._servo._thread.join(30.0)
        running.append(wire._servo.is_running)

    wire.set(6.0).add_callback(wait_for_the_end)
    wire.stop()
    assert running == [False]


@pytest.mark.exhaustive
def test_failed_stage_permits_no_flight(identified):
    with smadrive.open_rig("in-process") as rig:
        wire = SmaWire(rig, identified.wire_file)
    with pytest.raises(ConfigError):
        wire.stage()
    wire.prepare(SINE)
    with pytest.raises(ConfigError, match="staged"):
        wire.kickoff()


def test_reading_right_after_the_first_set_waits_for_a_tick(rig, wire):
    wire.set(6.0)
    assert wire.read()["wire_setpoint_mm"]["value"] >= 0.0
    wire.stop()


@pytest.mark.exhaustive
def test_emergency_stop_fails_the_motion_and_lets_stop_return(identified, tmp_path, monkeypatch):
    """A run engine stops several devices one after the other: an error that is no Exception would end that.

    The script gets this error when it closes the rig, so that it does not heat again.
    """
    monkeypatch.chdir(tmp_path)
    with served() as (_, url):
        text = (configs_dir() / "rigs" / "simulated.toml").read_text()
        text = text.replace(load_rig("simulated").devices[0].url, url.split("?")[0] + PATIENT)
        (tmp_path / "rig.toml").write_text(with_limits(text, 5.0, 5.0))
        with smadrive.open_rig("rig.toml") as rig:
            wire = SmaWire(rig, identified.wire_file)
            motion = wire.set(6.0)
            wire.read()
            off = programs.run(
                [sys.executable, "-m", "smadrive", "off", "rig.toml"], capture_output=True, text=True, check=False
            )
            assert isinstance(motion.exception(60.0), StoppedError), off.stderr
            wire.stop()
            assert not wire._servo.is_running
            with pytest.raises(StoppedError):
                rig.close()
