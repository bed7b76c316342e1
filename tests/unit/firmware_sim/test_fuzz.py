"""A bus where everything goes wrong, by seed and in virtual time; full size: tests/benchmarks/fuzz.py."""

import pytest
from benchmarks.fuzz import Fuzzer

from firmware_sim.bench import simulated_device
from firmware_sim.timeline import FaultScript
from smadrive.clock import VirtualClock
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.inprocess import InProcessTransport
from smadrive.modbus.master import Master
from smadrive.modbus.outstanding import Outstanding

TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)
SCRIPT = FaultScript.model_validate({"random": {"share": 0.3, "slowest_s": 0.6}})


def fuzzed(config, seed, numbered, exchanges):
    device = simulated_device(config, seed)
    device.bench.follow_script(SCRIPT)
    device.line.port = device.line.new_port(numbered=numbered)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    transport = InProcessTransport(device.line, clock, None if numbered else 115200)
    device.faults.ears.append(transport)
    master = Master(transport)
    return Fuzzer(master, seed, TIMING).run(exchanges), master.counters


@pytest.mark.parametrize("numbered", [False, True], ids=["rtu", "tcp"])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_wrong_value_is_accepted_nothing_hangs_and_every_failure_is_typed(config, seed, numbered):
    figures, counters = fuzzed(config, seed, numbered, 5000)
    assert figures.wrong == []
    assert figures.hangs == 0
    assert set(figures.errors) == {"DeadlineError", "ProtocolError", "ExceptionReply", "TransportError"}
    assert figures.right > 2000
    assert counters.reopenings > 0
    assert numbered or counters.probes > 0


def test_the_oracle_finds_what_a_careless_master_takes(config, monkeypatch):
    """The same fuzz against a client that forgets outstanding replies: remembering them keeps wrong values out."""
    monkeypatch.setattr(Outstanding, "add", lambda *_: None)
    figures, _ = fuzzed(config, 1, numbered=False, exchanges=2000)
    assert figures.wrong
