"""A simulated rig, and raw requests to it on its own time."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.modbus.framing import rtu


@pytest.fixture(scope="session")
def config():
    return load_sim("flexinol-lt-0.15mm")


@pytest.fixture
def rig(config):
    return simulated_device(config, seed=1)


@pytest.fixture
def ask(rig):
    """Send a PDU (hexadecimal) to unit 1, or to another; the reply's PDU, None when there is silence."""

    def send(pdu, unit=1):
        replies = rig.line.receive(rtu.seal(unit, bytes.fromhex(pdu)), rig.bench.time_s)
        if not replies:
            return None
        ((_, frame),) = replies
        assert rtu.crc_holds(frame)
        assert frame[0] == unit
        return frame[1:-2].hex(" ").upper()

    return send


@pytest.fixture
def heat(rig):
    """Arm the rig, then command a current with a new sequence number every 50 ms for a while."""

    def run(current_a, duration_s, watchdog_s=0.5):
        firmware = rig.firmware
        if firmware.state == 0:
            firmware.write({"watchdog_s": watchdog_s})
            firmware.write({"arm": 0x4152})
        end_s = rig.bench.time_s + duration_s
        while rig.bench.time_s < end_s - 1e-9:
            firmware.write({"sequence": firmware.sequence + 1, "heater_current": current_a, "heater_enable": 1})
            rig.bench.advance_to(min(rig.bench.time_s + 0.05, end_s))

    return run
