"""A line on which characters take time."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.bus.line_speed import SlowLine
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.in_process import InProcessTransport
from smadrive.modbus.transports.transport import SerialSettings


@pytest.mark.parametrize(
    ("settings", "exchange_s"),  # 8 + 21 characters and two pauses of 3.5
    [
        (SerialSettings(9600), 29 * 10 / 9600 + 2 * 3.5 * 11 / 9600),
        (SerialSettings(19200, "E"), 29 * 11 / 19200 + 2 * 3.5 * 11 / 19200),
        (SerialSettings(115200, "N", 2), 29 * 11 / 115200 + 2 * 1.75e-3),
    ],
    ids=["9600 8N1", "19200 8E1", "115200 8N2"],
)
def test_exchange_takes_the_time_of_its_characters(simulated, settings, exchange_s):
    simulated.line.port = SlowLine(simulated.line.port, settings)
    client = ModbusClient(InProcessTransport(simulated.line, simulated.transport().clock, settings.baudrate))
    ends_s = []
    for _ in range(3):
        client.execute(1, requests.read_holding(16, 8), BusTiming(0.02, read_retries=0))
        ends_s.append(simulated.bench.time_s)
    assert ends_s[2] - ends_s[1] == pytest.approx(exchange_s)


def test_replies_to_back_to_back_requests_follow_each_other(config):
    simulated = simulated_device(config)
    line = SlowLine(simulated.line.port, SerialSettings(9600))
    request = rtu.seal(1, requests.read_holding(0, 2).pdu)
    (first_s, _), (second_s, _) = line.receive(2 * request, 1.0)
    assert first_s == pytest.approx(1.0 + (16 + 9) * 10 / 9600 + 3.5 * 11 / 9600)
    assert second_s == pytest.approx(first_s + 9 * 10 / 9600)
