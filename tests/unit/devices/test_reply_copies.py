"""A second copy of an earlier reply, which arrives late, is never taken for the value that a register holds."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.in_process import InProcessTransport

ZERO_WORD, ONE_BIT = bytes.fromhex("03 02 0000"), bytes.fromhex("02 01 01")
CELSIUS = bytes(2)
LATE_S = 0.0001


class CopyingLine:
    """The far end of a line. It returns `copy`, the copy of an earlier reply, just before the next reply."""

    def __init__(self, line):
        self.copy = None
        self._line = line

    def receive(self, data, time_s):
        replies = self._line.receive(data, time_s)
        copy, self.copy = self.copy, None
        return replies if copy is None else [(replies[0][0] - LATE_S, copy), *replies]


def simulated(profile):
    """Return a device of this profile, and the line between driver and device."""
    profile = load_profile(profile)
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=profile)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    line = CopyingLine(device.line)
    transport = InProcessTransport(line, clock, profile.serial_settings().baudrate)
    return Device(profile, ModbusClient(transport)), line


@pytest.mark.parametrize(
    ("profile", "before", "copy", "expected"),
    [
        ("riden-rd60xx", {"boot_power": 1.0}, ZERO_WORD, {"boot_power": 0.0}),
        ("delta-dtb", {"sv": 1.0, "comm_write_enable": 0.0}, ONE_BIT, {"sv": 0.0, "comm_write_enable": 1.0}),
    ],
    ids=["nonvolatile register", "register that write_order demands"],
)
def test_write_is_not_omitted_because_of_a_late_copy(profile, before, copy, expected):
    device, line = simulated(profile)
    for name, value in before.items():
        device.write(name, value)
    line.copy = rtu.seal(device.profile.unit_id, copy)
    device.write(next(iter(expected)), 0.0)
    readings = device.read(tuple(expected), proved=True)
    assert {name: reading.value for name, reading in readings.items()} == expected


def test_setpoint_has_the_scale_of_the_device_and_not_of_a_late_copy():
    device, line = simulated("autonics-tk")
    device.check_identity()
    scale = device.read(("decimal_point",), proved=True)["decimal_point"].raw
    line.copy = rtu.seal(device.profile.unit_id, bytes.fromhex("04 04") + bytes((0, scale + 1)) + CELSIUS)
    device.write("sv", 10.0)
    assert device.read(("sv",), proved=True)["sv"].value == 10.0
