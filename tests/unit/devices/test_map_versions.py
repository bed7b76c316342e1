"""The driver accepts boards of both map versions, and knows what a board of version 1 lacks."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, IdentityError
from smadrive.modbus.client import ModbusClient

LACKING = {name for name in load_profile("sma-reference").registers if name.endswith(("gain", "offset", "save"))}


@pytest.fixture
def connected(clock):
    """A function that returns a simulated board of a version, and the driver's device with a profile."""

    def connect(version, profile="sma-reference"):
        board = load_profile(f"sma-reference:map_version={version}")
        simulated = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=board)
        clock.follow(simulated.bench.advance_to)
        return simulated, Device(load_profile(profile), ModbusClient(simulated.transport(clock)))

    return connect


@pytest.mark.parametrize("version", [1, 2])
def test_board_of_each_version_heats_and_its_faults_are_named(connected, clock, version):
    simulated, device = connected(version)
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.6, temperature_max_c=130.0), clock)
    heater.connect()
    heater.arm(watchdog_s=0.5)
    for _ in range(20):
        clock.sleep_until(clock.now_s() + 0.05)
        assert heater.exchange(0.3).armed
    simulated.bench.plant.faults.break_wire()
    for _ in range(3):
        clock.sleep_until(clock.now_s() + 0.05)
        measurement = heater.exchange(0.3)
    assert measurement.device_faults == ("heater_open",)
    assert simulated.firmware.current_a == 0.0


@pytest.mark.parametrize(("version", "words"), [(1, None), (2, ("released",))])
def test_registers_that_version_1_lacks_are_absent_from_its_profile(connected, version, words):
    _, device = connected(version)
    device.check_identity()
    assert (device.profile.roles.estop is None) is (words is None)
    assert (device.profile.registers.keys() >= LACKING) is (words is not None)
    if words is None:
        with pytest.raises(ConfigError):
            device.read(("estop",))
    else:
        assert device.read(("estop",))["estop"].words == words


def test_emergency_stop_is_latched_and_has_a_fault_of_its_own(connected, clock):
    simulated, device = connected(2)
    heater = Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.6, temperature_max_c=130.0), clock)
    heater.connect()
    simulated.bench.known_faults()["press_estop"]()
    clock.sleep_until(clock.now_s() + 0.05)
    assert heater.exchange(0.0).device_faults == ("estop",)
    simulated.bench.known_faults()["release_estop"]()
    clock.sleep_until(clock.now_s() + 0.05)
    assert heater.exchange(0.0).device_faults == ("estop",)
    heater.source.clear_faults()
    assert heater.exchange(0.0).device_faults == ()


@pytest.mark.parametrize(("name", "fault"), [("silence_sensor_bus", "sensor_bus"), ("stick_actuator", "actuator")])
def test_faults_of_the_hardware_are_named_only_by_version_2(connected, clock, name, fault):
    for version, expected in ((1, ()), (2, (fault,))):
        simulated, device = connected(version)
        simulated.bench.known_faults()[name]()
        clock.sleep_until(clock.now_s() + 0.05)
        assert device.read(("faults",))["faults"].words == expected


def test_profile_of_one_version_refuses_the_other(connected):
    _, device = connected(2, "sma-reference:map_version=1")
    with pytest.raises(IdentityError) as error:
        device.check_identity()
    assert error.value.value == "map_version = 2"
