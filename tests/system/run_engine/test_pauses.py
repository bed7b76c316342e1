"""A wire moves again after a pause of the run engine only if this pause has ended its motion or its servo."""

import asyncio

import pytest
from bluesky import plan_stubs as bps
from bluesky import preprocessors as bpp
from bluesky.utils import RunEngineInterrupted

from .conftest import is_off

pytestmark = pytest.mark.exhaustive


def test_resume_returns_to_a_setpoint_from_before_the_checkpoint(engine, documents, rig, wire):
    @bpp.stage_decorator([wire])
    @bpp.run_decorator()
    def plan():
        yield from bps.mv(wire, 6.0)
        yield from bps.checkpoint()
        yield from bps.pause() if not is_paused.pop() else bps.null()
        yield from bps.trigger_and_read([wire])

    is_paused = [True, False]
    with pytest.raises(RunEngineInterrupted):
        engine(plan())
    assert is_off(rig, wire)
    engine.resume()
    (row,) = documents.events()
    assert row["wire_setpoint_mm"] == 6.0
    assert row["wire_displacement_mm"] == pytest.approx(6.0, abs=0.2)
    assert is_off(rig, wire)


def paused_reading(wire):
    """A plan that only reads the wire, and pauses itself."""
    yield from bps.rd(wire)
    yield from bps.checkpoint()
    yield from bps.pause()
    yield from bps.rd(wire)


def pause_and_resume(engine, plan):
    with pytest.raises(RunEngineInterrupted):
        engine(plan)
    engine.resume()


def test_resume_heats_no_wire_that_only_an_earlier_plan_has_set(engine, rig, wire):
    engine(bps.mv(wire, 6.0))
    pause_and_resume(engine, paused_reading(wire))
    assert is_off(rig, wire)


def test_resume_heats_no_wire_that_was_stopped_before_the_plan(engine, rig, wire):
    wire.set(6.0).wait()
    wire.stop()
    pause_and_resume(engine, paused_reading(wire))
    assert is_off(rig, wire)


def test_resume_heats_no_wire_that_the_plan_has_stopped(engine, rig, wire):
    def plan():
        yield from bps.mv(wire, 6.0)
        yield from bps.stop(wire)
        yield from paused_reading(wire)
        assert is_off(rig, wire)

    pause_and_resume(engine, plan())


def test_resume_heats_no_wire_after_an_aborted_pause(engine, rig, wire):
    wire.set(6.0).wait()
    with pytest.raises(RunEngineInterrupted):
        engine(paused_reading(wire))
    engine.abort()
    pause_and_resume(engine, paused_reading(wire))
    assert is_off(rig, wire)


def test_resume_heats_no_wire_whose_servo_has_ended_before_the_plan(engine, rig, wire):
    wire.set(6.0).wait()
    wire._servo.stop()
    pause_and_resume(engine, paused_reading(wire))
    assert is_off(rig, wire)


def test_resume_returns_to_a_setpoint_from_before_the_plan(engine, wire):
    wire.set(6.0).wait()
    pause_and_resume(engine, paused_reading(wire))
    assert wire.locate()["setpoint"] == 6.0
    wire.stop()


def test_second_pause_of_a_plan_keeps_the_setpoint(engine, rig, wire):
    def plan():
        yield from bps.mv(wire, 6.0)
        yield from paused_reading(wire)
        yield from paused_reading(wire)
        assert wire.locate()["setpoint"] == 6.0

    with pytest.raises(RunEngineInterrupted):
        pause_and_resume(engine, plan())
    engine.resume()
    assert is_off(rig, wire)


def test_suspended_wire_returns_to_its_setpoint_also_after_a_pause(engine, rig, wire):
    """The plan is paused while it is suspended."""
    go_on = asyncio.Event()

    async def released():
        go_on.set()

    def plan():
        yield from bps.mv(wire, 6.0)
        yield from bps.checkpoint()
        engine.request_suspend(released, pre_plan=paused_reading(wire))
        yield from bps.wait_for([go_on.wait])
        assert wire.locate()["setpoint"] == 6.0

    pause_and_resume(engine, plan())
    assert is_off(rig, wire)
