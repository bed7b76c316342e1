"""A servo holds the wire and moves it to setpoints that the script gives while the loop runs."""

import shutil
import signal
import threading
import time
from dataclasses import replace
from itertools import count, pairwise

import numpy as np
import pytest
from signal_injection import InterruptedLine

import smadrive
from smadrive.control.references.holding import APPROACH_S
from smadrive.errors import ConfigError, MotionError, SafetyError, TripError
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.safety.shutdown import shutdown_of
from smadrive.scripting import open_rig
from smadrive.scripting import servo as servo_module
from smadrive.wire.health.record import read_health
from smadrive.wire.identified_wire import load_wire


@pytest.fixture(scope="module")
def wire(identified):
    """The identified wire, without its file: the runs of these tests add to no health record."""
    return replace(load_wire(identified.wire_file), source="")


@pytest.fixture
def servo(rig, wire, tmp_path):
    with rig.servo(wire, tmp_path / "servo.h5") as running:
        yield running


def test_wire_moves_from_setpoint_to_setpoint(servo):
    for setpoint_mm in (2.0, 8.0, 5.0):
        motion = servo.move(setpoint_mm, tolerance_mm=0.2, settle_s=1.0)
        motion.wait()
        assert motion.success
        settled = servo.tick
        assert abs(settled.measurement.displacement_mm - setpoint_mm) < 0.2
        assert settled.command.setpoint_mm == setpoint_mm
    servo.sample().wait()
    assert servo.tick.time_s == pytest.approx(settled.time_s + 0.05)
    servo.stop()
    assert not servo.is_running
    with pytest.raises(MotionError):
        _ = servo.measurement
    run = servo.run
    assert run.kind == "servo"
    assert (run.trips, run.ticks, run.missed_deadlines) == (0, len(run["time_s"]), 0)
    steps_mm = np.abs(np.diff(run["setpoint_mm"][5:]))
    assert steps_mm.max() < 0.2
    assert [event.message.partition(" with")[0] for event in run.log.events if "move" in event.message] == [
        "move to 2 mm",
        "move to 8 mm",
        "move to 5 mm",
    ]


def test_reference_is_followed_after_its_approach(servo):
    ticks = []
    servo.takers.append(ticks.append)
    approach, whole = servo.follow(smadrive.sine(low_mm=3, high_mm=7, period_s=20, cycles=1))
    approach.wait()
    whole.wait()
    assert (approach.success, whole.success, servo.dropped) == (True, True, 0)
    times_s = [tick.time_s for tick in ticks]
    assert all(0.0 < later - earlier < 0.06 for earlier, later in pairwise(times_s))
    assert times_s[-1] - times_s[0] == pytest.approx(30.0, abs=0.2)
    assert max(tick.command.setpoint_mm for tick in ticks) == pytest.approx(7.0, abs=0.01)


def test_time_of_a_tick_follows_the_clock_when_it_is_set(servo, monkeypatch):
    servo.sample().wait()
    tick, clock = servo.tick, time.time
    before_s = servo.unix_s(tick)
    monkeypatch.setattr(time, "time", lambda: clock() + 3600.0)
    assert servo.unix_s(tick) - before_s == pytest.approx(3600.0, abs=0.1)


def test_newer_motion_replaces_an_older_one(servo):
    older, newer = servo.move(3.0), servo.move(4.0)
    newer.wait()
    assert isinstance(older.exception(), MotionError)
    approach, whole = servo.follow(smadrive.sine(low_mm=3, high_mm=7, period_s=20))
    servo.move(4.0).wait()
    assert isinstance(approach.exception(), MotionError)
    assert isinstance(whole.exception(), MotionError)


def test_setpoint_that_is_not_reached_is_an_error(servo):
    motion = servo.move(4.0, tolerance_mm=1e-6, timeout_s=3.0)
    with pytest.raises(MotionError) as failed:
        motion.wait()
    assert failed.value.limit == "1e-06 mm"
    servo.move(4.5).wait()


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"displacement_mm": 50.0}, "displacement_mm"),
        ({"displacement_mm": float("nan")}, "displacement_mm"),
        ({"displacement_mm": 4.0, "speed_mm_per_s": 0.0}, "speed_mm_per_s"),
        ({"displacement_mm": 4.0, "tolerance_mm": -1.0}, "tolerance_mm"),
        ({"displacement_mm": 4.0, "timeout_s": float("inf")}, "timeout_s"),
        ({"displacement_mm": 4.0, "speed_mm_per_s": 1e-6}, "speed_mm_per_s"),
        ({"displacement_mm": "4"}, "displacement_mm"),
    ],
)
def test_impossible_moves_are_refused(servo, options, where):
    with pytest.raises(ConfigError) as refused:
        servo.move(**options)
    assert refused.value.where == where


@pytest.mark.exhaustive
@pytest.mark.parametrize(("low_mm", "high_mm"), [(3.0, None), (None, 6.0)])
def test_displacement_beyond_a_limit_of_the_rig_is_refused_before_the_wire_moves(wire, tmp_path, low_mm, high_mm):
    config = load_rig("in-process")
    limits = config.limits.model_copy(update={"displacement_min_mm": low_mm, "displacement_max_mm": high_mm})
    with (
        smadrive.open_rig(config.model_copy(update={"limits": limits})) as rig,
        rig.servo(wire, tmp_path / "servo.h5") as servo,
    ):
        assert servo.limits[0 if high_mm is None else 1] == (high_mm or low_mm)
        with pytest.raises(ConfigError) as refused:
            servo.move(2.0 if high_mm is None else 7.0)
        assert refused.value.where == "displacement_mm"
        with pytest.raises(ConfigError):
            servo.follow(smadrive.sine(low_mm=2, high_mm=7, period_s=20))


def test_endless_reference_is_refused(servo):
    with pytest.raises(ConfigError):
        servo.follow(smadrive.sine(low_mm=3, high_mm=7, period_s=20).without_end(1.0))


@pytest.mark.exhaustive
def test_repeated_reference_is_followed_with_all_its_cycles(servo):
    swing = smadrive.sine(low_mm=3, high_mm=4, period_s=10, cycles=1)
    _, tracking = servo.follow(swing.repeated(3, 1.0))
    tracking.wait()
    assert servo.tick.time_s == pytest.approx(APPROACH_S + 30.0, abs=0.5)


def test_rig_is_busy_while_a_servo_runs(rig, servo):
    with pytest.raises(ConfigError, match="servo"):
        rig.measure()
    servo.stop()
    assert rig.measure().current_a < 0.01
    late = servo.move(4.0)
    assert late.done
    assert isinstance(late.exception(), MotionError)


def test_state_of_the_rig_names_the_servo(rig, servo):
    running = dict(rig.facts())["state"]
    servo.stop()
    assert "servo" in running
    assert dict(rig.facts())["state"] not in {running, "closed"}


def test_callbacks_are_called_once(servo):
    called = []
    motion = servo.move(3.0)
    motion.add_callback(called.append)
    motion.wait()
    motion.add_callback(called.append)
    servo.stop()
    assert called == [motion, motion]


def fails(_argument):
    raise ZeroDivisionError


def test_error_in_a_function_of_the_script_is_shown_and_ends_nothing(rig, servo, monkeypatch):
    shown, ticks = [], []
    monkeypatch.setattr(threading, "excepthook", shown.append)
    servo.takers += [fails, ticks.append]
    motion = servo.move(3.0)
    motion.add_callback(fails)
    motion.wait()
    servo.move(4.0).wait()
    servo.stop()
    assert [one.exc_type for one in shown] == [ZeroDivisionError] * 2
    assert ticks[-1].measurement.displacement_mm == pytest.approx(4.0, abs=0.2)
    assert not rig.measure().armed


@pytest.mark.parametrize("waiting", ["motion", "rig"])
def test_function_that_waits_in_a_callback_gets_an_error_at_once(rig, servo, monkeypatch, waiting):
    shown = []
    monkeypatch.setattr(threading, "excepthook", shown.append)
    motion = servo.move(3.0)
    motion.add_callback(lambda _: servo.move(4.0).wait() if waiting == "motion" else rig.close())
    motion.wait()
    if waiting == "motion":
        servo.move(5.0).wait()
        servo.stop()
    assert isinstance(servo.move(6.0).exception(None), MotionError)
    assert not rig.measure().armed
    assert [one.exc_type for one in shown] == [MotionError]


def test_off_stops_a_servo(rig, servo):
    motion = servo.move(8.0, speed_mm_per_s=0.001)
    rig.off()
    assert not servo.is_running
    assert isinstance(motion.exception(None), MotionError)
    assert not rig.measure().armed


@pytest.mark.parametrize("where", ["callback", "taker"])
def test_servo_can_be_stopped_in_a_function_that_it_calls(rig, servo, where):
    if where == "taker":
        motion = servo.move(8.0, speed_mm_per_s=0.001)  # over an hour, but virtual
        servo.takers.append(lambda tick: tick.time_s > 1.0 and servo.stop())
        assert isinstance(motion.exception(None), MotionError)
    else:
        motion = servo.move(4.0)
        motion.add_callback(lambda _: servo.stop())
        motion.wait()
    servo.stop()
    assert not rig.measure().armed


@pytest.mark.exhaustive
def test_trip_fails_the_motion_and_ends_at_zero_current(wire, tmp_path):
    config = load_rig("in-process")
    limits = config.limits.model_copy(update={"tracking_max_mm": 0.5, "tracking_for_s": 0.2})
    with smadrive.open_rig(config.model_copy(update={"limits": limits})) as rig:
        servo = rig.servo(wire, tmp_path / "tripped.h5")
        servo.move(8.0).wait()
        motion = servo.move(3.0, speed_mm_per_s=100.0)  # faster than the wire cools
        assert isinstance(motion.exception(None), TripError)
        with pytest.raises(TripError) as tripped:
            servo.stop()
        assert shutdown_of(tripped.value).confirmed
        with pytest.raises(TripError):
            _ = servo.measurement
        with pytest.raises(SafetyError, match="refused to arm"), rig.servo(wire, tmp_path / "again.h5") as again:
            again.move(4.0).wait()
        rig.clear_faults()
        assert rig.measure().current_a < 0.01
    assert servo.run.trips == 1


@pytest.mark.exhaustive
def test_closing_the_rig_ends_its_servo(wire, tmp_path):
    with smadrive.open_rig("in-process") as rig:
        servo = rig.servo(wire, tmp_path / "servo.h5")
        servo.move(3.0).wait()
    assert not servo.is_running
    assert servo.run.log.ended_by == ""


@pytest.mark.exhaustive
def test_run_of_a_servo_adds_to_the_health_record_of_its_wire(rig, identified, tmp_path):
    wire_file = shutil.copy(identified.wire_file, tmp_path / "wire.json")
    with rig.servo(load_wire(wire_file), tmp_path / "servo.h5") as servo:
        for setpoint_mm in (8.0, 2.0):
            servo.move(setpoint_mm).wait()
    assert servo.run.caveats == ()
    run = read_health(wire_file).entries[-1]
    assert (run.log, run.cycles, run.tripped) == ("servo.h5", 1.0, False)


@pytest.fixture
def blind():
    """A rig file without a displacement sensor, which takes the displacement from the resistance."""
    config = load_rig("in-process")
    board = config.devices[0].model_copy(update={"measures": ("temperature",)})
    return config.model_copy(update={"devices": (board,), "displacement_from": DisplacementFrom.RESISTANCE})


@pytest.mark.exhaustive
def test_servo_warns_of_a_warm_wire_whose_displacement_is_unknown(wire, tmp_path):
    config, counts = load_rig("in-process").model_copy(update={"displacement_from": DisplacementFrom.NONE}), []
    with smadrive.open_rig(config) as rig:
        for name in ("cold.h5", "warm.h5"):
            with rig.servo(wire, tmp_path / name) as servo:
                servo.move(8.0, tolerance_mm=1.0).wait()
            counts.append(sum(event.message.startswith("warning: ") for event in servo.run.log.events))
    assert counts == [0, 1]


@pytest.mark.exhaustive
def test_servo_takes_the_displacement_from_the_resistance(blind, wire, tmp_path):
    with smadrive.open_rig(blind) as rig, rig.servo(wire, tmp_path / "servo.h5") as servo:
        for setpoint_mm in (8.0, 5.0):
            servo.move(setpoint_mm, tolerance_mm=0.2, settle_s=1.0).wait()
    uses = servo.run.log.columns["uses_resistance"]
    assert uses[-20:].all()
    assert abs(servo.run.log.columns["by_resistance_mm"][-1] - 5.0) < 0.6


@pytest.mark.exhaustive
def test_servo_by_resistance_needs_the_resistance_of_the_wire(blind, wire, tmp_path):
    without = replace(wire, resistance=None)
    with (
        smadrive.open_rig(blind) as rig,
        pytest.raises(ConfigError) as refused,
        rig.servo(without, tmp_path / "servo.h5"),
    ):
        pass
    assert refused.value.where == "displacement_from"


@pytest.mark.exhaustive
@pytest.mark.parametrize("lines", [1, 97])
def test_servo_whose_creation_is_interrupted_at_any_line_can_be_stopped(wire, tmp_path, lines):
    """An interruption at every line, or at every 97th one."""

    def interrupt():
        signal.raise_signal(signal.SIGINT)

    rig = smadrive.open_rig("in-process")
    try:
        for at in count(step=lines):
            with InterruptedLine(at, open_rig, servo_module, threading, interrupt=interrupt) as interrupted:
                rig.servo(wire, tmp_path / f"{at}.h5")
            rig._stop_servo()
            assert not any(thread.name == "servo" for thread in threading.enumerate())
            if not interrupted.reached:
                break
        assert not rig.measure().armed
    finally:
        rig._client.end()
