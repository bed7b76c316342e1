"""A signal may interrupt an exchange at any line. The next exchange must work, because it switches the heater off.

A connection that was opened during the interrupted exchange must count as new: nothing is known of its device and bus.
"""

from itertools import count

import pytest
from modbus_model import TIMING, Device, Fault
from signal_injection import InterruptedLine

from smadrive.clock import VirtualClock
from smadrive.modbus import bus_line, protocol, requests
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports import in_process
from smadrive.modbus.transports.in_process import InProcessTransport

READ = requests.read_holding(1, 2)


class InterruptingDevice(Device):
    """Raises KeyboardInterrupt when a request with a fault has arrived."""

    def receive(self, data, time_s):
        interrupts = bool(self.faults)
        arriving = super().receive(data, time_s)
        if interrupts:
            raise KeyboardInterrupt
        return arriving


@pytest.mark.parametrize("device_class", [Device, InterruptingDevice], ids=["one signal", "two signals"])
@pytest.mark.parametrize("numbered", [False, True], ids=["rtu", "tcp"])
def test_interrupted_exchange_leaves_a_client_that_works(numbered, device_class):
    for at in count():
        device = device_class(numbered)
        client = ModbusClient(InProcessTransport(device, VirtualClock(), None if numbered else 115200))
        client.execute(1, READ, TIMING)
        device.faults.append(Fault(late_s=0.05))
        with InterruptedLine(at, bus_line, protocol) as interruption:
            client.execute(1, READ, TIMING)
        device.faults.clear()
        assert client.execute(1, READ, TIMING, proved=True) == device.answered[READ.pdu][2:]
        if not interruption.reached:
            break
    assert at > 50


class ListeningDevice(Device):
    """Records the times of the requests."""

    def __init__(self):
        super().__init__(numbered=False)
        self.heard_s = []

    def receive(self, data, time_s):
        self.heard_s.append(time_s)
        return super().receive(data, time_s)


def test_connection_that_an_interrupted_call_opened_is_a_new_one():
    for at in count():
        device = ListeningDevice()
        client = ModbusClient(InProcessTransport(device, VirtualClock()))
        client.execute(1, READ, TIMING)
        client.clock.sleep_until(10.0)
        before = client.connection
        device.heard_s.clear()
        client.transport.disconnect()
        with InterruptedLine(at, bus_line, in_process) as interruption:
            client.execute(1, READ, TIMING)
        assert client.connection != before
        client.execute(1, READ, TIMING)
        assert device.heard_s[0] >= 10.0 + TIMING.response_timeout_s
        if not interruption.reached:
            break
    assert at > 30
