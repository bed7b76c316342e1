"""The protections of simulated supplies, read by the driver, on every map that has them."""

import pytest

from firmware_sim.bench import simulated_device
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.client import ModbusClient

SUPPLIES = ("riden-rd60xx", "xy-sk-family", "hanmatek-hm30x")


@pytest.fixture(params=SUPPLIES)
def supply(request, config):
    """A simulated supply with its output on at 0.3 A and at most 12 V, and the driver's device."""
    profile = load_profile(request.param)
    simulated = simulated_device(config, profile=profile)
    clock = VirtualClock()
    clock.follow(simulated.bench.advance_to)
    device = Device(profile, ModbusClient(simulated.transport(clock)))
    device.check_identity()
    for name, value in (("ovp", 30.0), ("ocp", 1.0), ("v_set", 12.0), ("i_set", 0.3), ("output", 1)):
        device.write(name, value)
    return simulated, device


def latched(device):
    reading = device.read(("protection",))["protection"]
    return tuple(word for word in reading.words if word != "ok")


def test_no_protection_is_latched_at_first_and_limits_can_be_read(supply):
    simulated, device = supply
    simulated.bench.advance_to(simulated.bench.time_s + 1.0)
    assert latched(device) == ()
    readings = device.read(("ovp", "ocp", "output"))
    assert [readings[name].value for name in ("ovp", "ocp", "output")] == [30.0, 1.0, 1]


def test_the_highest_protection_of_a_map_can_be_written(supply):
    """6.1 A are 6100 steps of 1 mA, and 6100 * 0.001 is a little more than 6.1."""
    _, device = supply
    for role in ("ovp", "ocp"):
        register = device.profile.register(device.profile.role(role))
        device.write(device.profile.role(role), register.max)


def test_measured_overcurrent_switches_the_output_off(supply):
    simulated, device = supply
    simulated.bench.plant.faults.short_switch(1.5)
    simulated.bench.advance_to(simulated.bench.time_s + 0.1)
    assert latched(device) == ("ocp",)
    assert not simulated.firmware.on
    assert any("ocp: " in event and "output off" in event for event in simulated.bench.events)


def test_setpoint_above_the_protection_trips_at_once(supply):
    simulated, device = supply
    device.write("ovp", 11.0)
    assert latched(device) == ("ovp",)
    assert simulated.firmware.current_a == 0.0


def test_latched_protection_keeps_the_output_off_until_reset(supply):
    simulated, device = supply
    device.write("ocp", 0.2)
    device.write("i_set", 0.1)
    simulated.firmware.write({"heater_enable": 1.0})
    assert (simulated.firmware.on, latched(device)) == (False, ("ocp",))
    if device.profile.register("protection").writable:
        device.write("protection", 0)
    else:
        simulated.power_cycle()
        device.client.clock.sleep_until(simulated.bench.time_s + 3.0)
        device.write("v_set", 12.0)
    assert (simulated.firmware.on, latched(device)) == (False, ())
    device.write("output", 1)
    assert simulated.firmware.on


def test_reset_fails_while_the_cause_persists(config):
    simulated = simulated_device(config, profile=load_profile("xy-sk-family"))
    firmware = simulated.firmware
    firmware.write({"ovp": 10.0, "heater_voltage": 12.0})
    assert firmware.latched == "ovp"
    firmware.write({"faults": 0.0})
    assert firmware.latched == "ovp"
    firmware.write({"heater_voltage": 9.0, "faults": 0.0})
    assert firmware.latched == "ok"
