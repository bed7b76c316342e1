"""The real driver and a simulated rig, in process and in virtual time, with real frames and without mocks."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.client import ModbusClient

TICK_S = 0.05


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def rig(clock):
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1)
    clock.follow(device.bench.advance_to)
    return device


@pytest.fixture
def device(rig, clock):
    return Device(load_profile("sma-reference"), ModbusClient(rig.transport(clock)))


@pytest.fixture
def heater(device, clock):
    return Heater(HeaterBoard(device, clock), HeaterLimits(current_max_a=0.6, temperature_max_c=130.0), clock)


@pytest.fixture
def run(heater, clock):
    """Return a function that exchanges every 50 ms for some ticks and returns the measurements."""

    def ticks(current_a, duration_s):
        measured = []
        for _ in range(round(duration_s / TICK_S)):
            clock.sleep_until(clock.now_s() + TICK_S)
            measured.append(heater.exchange(current_a))
        return measured

    return ticks
