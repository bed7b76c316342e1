"""A board whose meters of current and voltage do not answer: its current is unknown, never zero."""

from math import isnan

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import UnknownCurrentError
from smadrive.modbus.client import ModbusClient


@pytest.fixture
def hot(heater, run):
    """A board that heats."""
    heater.connect()
    heater.arm(0.5)
    run(0.3, 0.5)
    return heater


@pytest.fixture
def latched(hot, rig, clock):
    """A board whose meters answer again, and whose fault is latched. Its register shows the true current, 0 A.

    A board with old firmware looks the same while its meters are silent.
    """
    rig.bench.sensors.faults.silence_sensor_bus(for_s=0.1)
    clock.sleep_until(clock.now_s() + 0.5)
    return hot


@pytest.mark.parametrize("fault", ["silence_sensor_bus", "lose_current", "lose_voltage"])
def test_registers_of_silent_meters_show_no_reading(hot, device, rig, clock, fault):
    rig.bench.known_faults()[fault]()
    clock.sleep_until(clock.now_s() + 0.05)
    readings = device.read(("measured_current", "measured_voltage", "faults"))
    assert [readings[name].invalid for name in ("measured_current", "measured_voltage")] == ["no reading"] * 2
    assert readings["faults"].words == ("sensor_bus",)
    assert rig.firmware.current_a == 0.0


@pytest.mark.parametrize("for_s", [None, 0.1])
def test_current_is_unknown_while_the_fault_is_latched(hot, rig, clock, for_s):
    rig.bench.sensors.faults.silence_sensor_bus(for_s=for_s)
    clock.sleep_until(clock.now_s() + 0.5)
    measurement = hot.exchange(0.0)
    assert measurement.device_faults == ("sensor_bus",)
    assert isnan(measurement.current_a)
    assert isnan(measurement.voltage_v)
    assert measurement.supply_fault == "sensor_bus"


def test_silent_meters_do_not_confirm_that_the_heater_is_off(hot, rig):
    rig.bench.sensors.faults.silence_sensor_bus()
    with pytest.raises(UnknownCurrentError) as error:
        hot.enter_safe_state()
    assert (error.value.value, error.value.exit_code) == ("sensor_bus", 4)
    assert rig.firmware.current_a == 0.0


def test_fault_is_cleared_before_the_current_is_known(latched):
    with pytest.raises(UnknownCurrentError):
        latched.enter_safe_state()
    measurement = latched.clear_faults()
    assert (measurement.device_faults, measurement.supply_fault) == ((), None)
    assert measurement.current_a == pytest.approx(0.0, abs=0.01)
    latched.enter_safe_state()


def test_fault_with_a_lasting_cause_is_not_cleared(hot, rig, clock):
    rig.bench.sensors.faults.silence_sensor_bus()
    clock.sleep_until(clock.now_s() + 0.05)
    with pytest.raises(UnknownCurrentError):
        hot.clear_faults()


def test_temperature_counts_after_a_new_conversion(latched, clock):
    assert latched.connect().temperature_fault == "sensor_bus"
    clock.sleep_until(clock.now_s() + 0.2)
    assert latched.exchange(0.0).temperature_fault is None


def test_board_of_version_1_shows_no_current_and_names_no_fault_of_its_meters(clock):
    profile = load_profile("sma-reference:map_version=1")
    simulated = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=profile)
    clock.follow(simulated.bench.advance_to)
    device = Device(profile, ModbusClient(simulated.transport(clock)))
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(0.6, 130.0), clock)
    heater.connect()
    simulated.bench.sensors.faults.silence_sensor_bus()
    clock.sleep_until(clock.now_s() + 0.05)
    measurement = heater.exchange(0.0)
    assert (measurement.current_a, measurement.device_faults) == (0.0, ())
