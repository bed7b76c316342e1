"""Fixtures: a simulated device, raw requests to it on its own time, and a heated bench."""

import pytest

from firmware_sim.bench import SimulatedBench, simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.framing import rtu


@pytest.fixture(scope="session")
def config():
    return load_sim("flexinol-lt-0.15mm")


@pytest.fixture
def simulated(config):
    return simulated_device(config, seed=1)


@pytest.fixture
def ask(simulated):
    """A function that sends a PDU (hexadecimal) to a unit, and returns the PDU of the reply; None without a reply."""

    def send(pdu, unit=1):
        replies = simulated.line.receive(rtu.seal(unit, bytes.fromhex(pdu)), simulated.bench.time_s)
        if not replies:
            return None
        ((_, frame),) = replies
        assert rtu.crc_holds(frame)
        assert frame[0] == unit
        return frame[1:-2].hex(" ").upper()

    return send


@pytest.fixture
def heat(simulated):
    """A function that arms the board, then commands a current with a new sequence number every 50 ms."""

    def run(current_a, duration_s, watchdog_s=0.5):
        firmware = simulated.firmware
        if firmware.state == 0:
            firmware.write({"watchdog_s": watchdog_s})
            firmware.write({"arm": 0x4152})
        end_s = simulated.bench.time_s + duration_s
        while simulated.bench.time_s < end_s - 1e-9:
            firmware.write({"sequence": firmware.sequence + 1, "heater_current": current_a, "heater_enable": 1})
            simulated.bench.advance_to(min(simulated.bench.time_s + 0.05, end_s))

    return run


@pytest.fixture
def bench(config):
    """A wire that a supply heats with 0.25 A, hot and nearly settled."""
    bench = SimulatedBench(config, seed=1)
    bench.attach(load_profile("riden-rd60xx"), name="supply")
    bench.devices[0].firmware.write({"heater_current": 0.25, "heater_voltage": 12.0, "heater_enable": 1})
    bench.advance_to(20.0)
    return bench


@pytest.fixture
def watch():
    """A function that runs a bench, and returns `value(bench)` every 20 ms."""

    def run(bench, duration_s, value):
        end_s, values = bench.time_s + duration_s, []
        while bench.time_s < end_s - 1e-9:
            bench.advance_to(bench.time_s + 0.02)
            values.append(value(bench))
        return values

    return run
