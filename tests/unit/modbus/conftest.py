"""A server with scripted answers, on virtual time."""

import pytest

from smadrive.clock import VirtualClock
from smadrive.errors import DeadlineError, ProtocolError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.in_process import InProcessTransport


class Script:
    """Answers request n with `answers[n]`, a list of (delay in seconds, bytes).

    `heard` records time and bytes of requests.
    """

    def __init__(self, *answers):
        self.answers = list(answers)
        self.heard = []

    def receive(self, data, time_s):
        self.heard.append((time_s, data))
        answer = self.answers.pop(0) if self.answers else []
        return [(time_s + delay_s, reply) for delay_s, reply in answer]


class Registers:
    """A slow device whose register n holds n. It answers in order; `delays_s` are the delays of its replies."""

    def __init__(self, delays_s=()):
        self.delays_s = list(delays_s)
        self.busy_until_s = 0.0

    def receive(self, data, time_s):
        first, count = int.from_bytes(data[2:4], "big"), int.from_bytes(data[4:6], "big")
        words = b"".join(register.to_bytes(2, "big") for register in range(first, first + count))
        delay_s = self.delays_s.pop(0) if self.delays_s else 0.001
        self.busy_until_s = max(time_s, self.busy_until_s) + delay_s
        return [(self.busy_until_s, rtu.seal(data[0], bytes((data[1], len(words))) + words))]


QUIET_S = 1.0
TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)


@pytest.fixture
def bus():
    """Make a client that talks to a peer on virtual time, on a bus that has been silent for a while."""

    def make(peer, baudrate=115200, trace=None):
        client = ModbusClient(InProcessTransport(peer, VirtualClock(), baudrate), trace)
        client.clock.sleep_until(QUIET_S)
        return client

    return make


@pytest.fixture
def script():
    return Script


@pytest.fixture
def slow_registers():
    return Registers


@pytest.fixture
def timing():
    return TIMING


@pytest.fixture(scope="session")
def slow_registers_class():
    return Registers


@pytest.fixture(scope="session")
def check_reads():
    """Check that each read of a device whose register n holds n fails or returns the right registers."""

    def check(client, asked):
        for first, count in asked:
            try:
                payload = client.execute(1, requests.read_holding(first, count), BusTiming(0.1, read_retries=1))
            except (DeadlineError, ProtocolError):
                continue
            assert requests.registers_of(payload) == tuple(range(first, first + count))

    return check
