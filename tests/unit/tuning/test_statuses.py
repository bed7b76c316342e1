"""The statuses of a session and of a watched rig have every field of the telemetry."""

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import observe
from smadrive.telemetry.schema import FAULTS, STATE, faults_message, state_message
from smadrive.tuning.watching import WatchFeed


def has_every_field(status):
    return set(state_message(status, "tune")) == set(STATE) and set(faults_message(status)) == set(FAULTS)


def test_status_of_a_session_has_every_field(rig):
    rig.run(until_s=0.3)
    assert has_every_field(rig.status)
    assert set(rig.status["devices"]) == {"board"}


def test_status_of_a_watched_rig_has_every_field_and_shows_its_faults(driver_end):
    device, clock = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=3), VirtualClock()
    clock.follow(device.bench.advance_to)
    with Rig(load_rig("in-process"), clock, {"board": device.transport(clock)}) as rig:
        feed = WatchFeed(rig, driver_end)
        assert has_every_field(driver_end.published)
        device.bench.sensors.faults.open_thermocouple()
        observe(rig, 1.0, feed.tick, lambda: False)
        assert faults_message(driver_end.published)["temperature_fault"] is not None
        assert driver_end.published["unexpected_current"] is None
        device.bench.plant.faults.short_switch(0.3)
        observe(rig, 2.0, feed.tick, lambda: False)
        assert driver_end.published["unexpected_current"] is not None
        device.bench.plant.faults.mend_heater()
        feed.end()
        assert (driver_end.published["mode"], driver_end.published["end"]) == ("off", "off")
