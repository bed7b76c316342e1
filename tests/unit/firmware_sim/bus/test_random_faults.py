"""A bus where everything goes wrong, by seed and in virtual time; full size: tests/benchmarks/fuzz.py."""

import pytest
from benchmarks.fuzz import Fuzzer

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
@pytest.mark.parametrize("seed", [1, 2])
def test_no_wrong_value_is_accepted_nothing_hangs_and_every_failure_is_typed(config, seed, numbered):
    figures, counters = fuzzed(config, seed, numbered, 5000, copies=numbered)
    assert figures.wrong == []
    assert figures.hangs == 0
    assert set(figures.errors) == {"DeadlineError", "ProtocolError", "ExceptionReply", "TransportError"}
    assert figures.right > 2000
    assert counters.reopenings > 0
    assert counters.probes > 0


@pytest.mark.parametrize("numbered", [False, True], ids=["rtu", "tcp"])
def test_a_proof_holds_where_plain_modbus_cannot_tell(config, numbered):
    """Copies behind the next request, and a lag by one reply."""
    figures, _ = fuzzed(config, 3, numbered, 5000, plain_is_sure=False, copies=True, lag=True)
    assert figures.wrong == []
    assert figures.proved > 500
    assert numbered or figures.indistinguishable + figures.caught > 0


def test_the_oracle_finds_what_a_careless_client_takes(config, monkeypatch):
    """The same fuzz against a client that forgets outstanding replies: remembering them keeps wrong values out."""
    monkeypatch.setattr(Outstanding, "add", lambda *_: None)
    figures, _ = fuzzed(config, 1, numbered=False, exchanges=2000)
    assert figures.wrong
