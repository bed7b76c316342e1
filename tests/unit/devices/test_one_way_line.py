"""On a line without replies, the safe state is still sent, but does not count as confirmed."""

import pytest
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.in_process import InProcessTransport

LOST_REQUESTS = range(4)


class OneWay:
    """The far end of a line. Once it is `broken`, it returns no reply and also loses the first requests."""

    def __init__(self, line):
        self.broken = False
        self.deaf_to = 0
        self._line = line

    def receive(self, data, time_s):
        if self.broken and self.deaf_to:
            self.deaf_to -= 1
            return []
        replies = self._line.receive(data, time_s)
        return [] if self.broken else replies


def source_on(profile, transport, clock):
    if not profile.has_registers:
        return TCLab(TCLabBoard(profile, transport), full_scale_a=0.6, full_scale_v=7.0)
    device = Device(profile, ModbusClient(transport))
    return HeaterBoard(device, clock) if profile.profile.role == "heater" else BenchSupply(device)


@pytest.fixture(params=["sma-reference", "riden-rd60xx", "hanmatek-hm30x", "tclab"])
def heating(request):
    """Yield a heat source that heats, its simulated device, and the line between both."""
    profile = load_profile(request.param)
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=1, profile=profile)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    clock.sleep_until(3.0)
    line = OneWay(device.line)
    settings = profile.serial_settings()
    source = source_on(profile, InProcessTransport(line, clock, settings.baudrate), clock)
    source.connect()
    source.configure(HeaterLimits(0.5, 130.0, 15.0 if request.param != "tclab" else 7.0), watchdog_s=10.0)
    source.arm()
    for _ in range(3):
        clock.sleep_until(clock.now_s() + 0.25)
        source.exchange(0.2)
    assert device.firmware.current_a > 0.1
    return source, device, line


@pytest.mark.parametrize("lost", LOST_REQUESTS)
@pytest.mark.parametrize("exchanges", [exhaustive(0), 2], ids=["at once", "after lost exchanges"])
def test_one_way_line_switches_off_without_confirmation(heating, lost, exchanges):
    source, device, line = heating
    line.broken = True
    for _ in range(exchanges):
        with pytest.raises(DeadlineError):
            source.exchange(0.2)
    line.deaf_to = lost
    with pytest.raises(DeadlineError):
        source.enter_safe_state()
    assert device.firmware.current_a == 0.0
