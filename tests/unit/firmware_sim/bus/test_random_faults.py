"""A bus with random faults in virtual time, seeded. The full size is tests/benchmarks/fuzz.py."""

import pytest
from benchmarks.fuzz import Fuzzer
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.fault_script import FaultScript
from smadrive.clock import VirtualClock
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.outstanding import Outstanding
from smadrive.modbus.transports.in_process import InProcessTransport

TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)
SHARE = {"share": 0.3, "slowest_s": 0.6}


def fuzzed(config, seed, numbered, exchanges, *, plain_is_sure=True, **beyond):
    device = simulated_device(config, seed)
    device.bench.follow_script(FaultScript.model_validate({"random": SHARE | beyond}))
    device.line.port = device.line.new_port(numbered=numbered)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    transport = InProcessTransport(device.line, clock, None if numbered else 115200)
    device.faults.connect(transport, numbered=numbered)
    client = ModbusClient(transport)
    return Fuzzer(client, seed, TIMING, plain_is_sure=plain_is_sure).run(exchanges), client.counters


@pytest.mark.parametrize("numbered", [False, True], ids=["rtu", "tcp"])
@pytest.mark.parametrize(("seed", "exchanges"), [(1, 500), exhaustive(1, 5000), exhaustive(2, 5000)])
def test_random_faults_cause_typed_errors_only_and_no_wrong_value(config, seed, exchanges, numbered):
    figures, counters = fuzzed(config, seed, numbered, exchanges, copies=numbered)
    assert figures.wrong == []
    assert figures.hangs == 0
    assert set(figures.errors) == {"DeadlineError", "ProtocolError", "ExceptionReply", "TransportError"}
    assert figures.right > 0.4 * exchanges
    assert counters.reopenings > 0
    assert counters.probes > 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("numbered", [False, True], ids=["rtu", "tcp"])
def test_proved_reads_are_correct_despite_undetectable_faults(config, numbered):
    """Unsolicited copies behind the next request, and replies that repeat the previous one."""
    figures, _ = fuzzed(config, 3, numbered, 5000, plain_is_sure=False, copies=True, lag=True)
    assert figures.wrong == []
    assert figures.proved > 500
    assert numbered or figures.indistinguishable + figures.caught > 0


@pytest.mark.exhaustive
def test_oracle_finds_wrong_values_of_a_client_without_memory(config, monkeypatch):
    """The same faults act on a client that forgets outstanding replies. This client accepts wrong values."""
    monkeypatch.setattr(Outstanding, "add", lambda *_: None)
    figures, _ = fuzzed(config, 1, numbered=False, exchanges=2000)
    assert figures.wrong
