"""Every fault of the bus gives the client a typed error, at once or at the deadline, and then correct values."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.bus.message import ModbusMessage
from smadrive.clock import VirtualClock
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient

TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)
READ = {"sma-reference": requests.read_holding(0, 5), "adam-6018": requests.read_coils(16, 8)}
WRITE = {"sma-reference": requests.write_register(32, 7), "adam-6018": requests.write_coil(19, True)}


@pytest.fixture(params=["sma-reference", "adam-6018"], ids=["rtu", "tcp"])
def profile(request):
    return load_profile(request.param)


@pytest.fixture
def bus(config, profile):
    """A device and its client, after one good reply."""
    clock = VirtualClock()
    device = simulated_device(config, 1, profile)
    clock.follow(device.bench.advance_to)
    client = ModbusClient(device.transport(clock))
    clock.sleep_until(2.0)
    client.execute(1, READ[profile.profile.id], TIMING)
    return device, client


@pytest.fixture
def read(bus, profile):
    return lambda: bus[1].execute(1, READ[profile.profile.id], TIMING)


ERRORS = {
    "corrupt": ProtocolError,
    "junk_before": ProtocolError,
    "wrong_unit": ProtocolError,
    "wrong_function": ProtocolError,
    "short_count": (ProtocolError, DeadlineError),  # RTU: only silence distinguishes a short reply from a slow one
    "drop": DeadlineError,
    "truncate": DeadlineError,
}


@pytest.mark.parametrize("name", ERRORS)
def test_bad_reply_raises_typed_error_within_deadline_and_next_reply_is_correct(bus, read, name):
    device, client = bus
    right = read()
    getattr(device.faults, name)()
    before_s = client.clock.now_s()
    with pytest.raises(ERRORS[name]):
        read()
    assert client.clock.now_s() - before_s < TIMING.response_timeout_s + 0.01
    assert read() == right


@pytest.mark.parametrize("code", [1, 2, 3, 4, 5, 6, 0x0B])
def test_request_with_exception_reply_is_not_carried_out(bus, profile, code):
    device, client = bus
    before = device.responder.counters.requests
    device.faults.refuse(code)
    with pytest.raises(ExceptionReply) as error:
        client.execute(1, WRITE[profile.profile.id], TIMING)
    assert error.value.code == code
    assert device.responder.counters.requests == before


def test_write_with_lost_reply_is_carried_out(bus, profile):
    device, client = bus
    before = device.responder.counters.requests
    device.faults.drop()
    with pytest.raises(DeadlineError):
        client.execute(1, WRITE[profile.profile.id], TIMING)
    assert device.responder.counters.requests == before + 1


def test_split_reply_is_accepted_but_not_beyond_the_deadline(bus, read):
    device, client = bus
    right = read()
    device.faults.split(pause_s=0.01, pieces=5)
    assert read() == right
    device.faults.split(pause_s=0.06, pieces=5)
    with pytest.raises(DeadlineError):
        read()
    client.clock.sleep_until(client.clock.now_s() + 0.3)
    assert read() == right


@pytest.mark.parametrize(("name", "parameters"), [("delay", {"delay_s": 0.15}), ("duplicate", {"after_s": 0.15})])
def test_late_reply_is_not_accepted_for_another_request(bus, read, name, parameters):
    device, _ = bus
    right = read()
    getattr(device.faults, name)(**parameters, replies=5)
    for _ in range(10):
        try:
            assert read() == right
        except (DeadlineError, ProtocolError):
            continue


def test_junk_behind_a_reply_is_not_accepted_as_a_reply(bus, read):
    device, client = bus
    right = read()
    device.faults.junk_after()
    try:
        assert read() == right  # a TCP frame ends where its length says
    except ProtocolError:
        assert not client.transport.framing.numbered
    try:
        assert read() == right
    except ProtocolError:
        assert client.transport.framing.numbered  # the junk stands before this reply
    assert read() == right


def test_noise_is_not_accepted_as_a_reply(bus, read):
    device, client = bus
    right = read()
    device.faults.noise(for_s=3.0, gap_s=0.02)
    outcomes = set()
    while client.clock.now_s() < 8.0:
        client.clock.sleep_until(client.clock.now_s() + 0.1)
        try:
            outcomes.add(read())
        except (ProtocolError, TransportError) as error:
            outcomes.add(type(error))
    assert right in outcomes
    assert all(outcome == right for outcome in outcomes if isinstance(outcome, bytes))
    assert read() == right


def test_lost_port_is_reopened_after_its_return(bus, read):
    device, client = bus
    right = read()
    device.faults.vanish(for_s=2.0)
    for _ in range(3):
        with pytest.raises(TransportError):
            read()
    client.clock.sleep_until(client.clock.now_s() + 2.0)
    assert read() == right
    assert client.counters.reopenings == 1


def test_port_returns_after_the_longest_of_several_outages(bus, read):
    device, client = bus
    device.faults.vanish(for_s=2.0)
    device.faults.vanish(for_s=1.0)
    client.clock.sleep_until(client.clock.now_s() + 1.5)
    with pytest.raises(TransportError):
        read()
    client.clock.sleep_until(client.clock.now_s() + 0.5)
    assert read()


def test_restarting_device_ignores_requests_for_its_boot_time(config):
    device = simulated_device(config, 1, load_profile("xy-sk-family"))
    boot_s = device.profile.timing.boot_ms / 1e3
    assert boot_s > 0
    timing = BusTiming(0.1, min_gap_s=0.05, read_retries=0)
    client = ModbusClient(device.transport())
    client.clock.sleep_until(boot_s)
    read = requests.read_holding(0, 2)
    right = client.execute(1, read, timing)
    device.power_cycle()
    with pytest.raises(DeadlineError):
        client.execute(1, read, timing)
    client.clock.sleep_until(device.bench.time_s + boot_s)
    assert client.execute(1, read, timing) == right


def test_stale_reply_repeats_the_previous_one(bus, profile, read):
    device, client = bus
    right = read()
    device.faults.stale()
    with pytest.raises(ProtocolError):
        client.execute(1, WRITE[profile.profile.id], TIMING)
    assert len(read()) == len(right)


def test_faults_last_for_a_time_or_a_number_of_replies_in_planned_order(config):
    faults = simulated_device(config, 1).faults
    faults.refuse(6, for_s=1.0)
    faults.refuse(5, replies=1)
    request = ModbusMessage(1, bytes.fromhex("03 0000 0001"))
    answers = [faults.answer(request, lambda _pdu: b"\x03\x02\x00\x07", 0.1 * tenth) for tenth in range(15)]
    codes = [frame[2] if frame[1] & 0x80 else 0 for ((_, frame),) in answers]
    assert codes == [6] * 10 + [5] + [0] * 4


def test_broadcast_is_carried_out_and_uses_up_no_fault(config):
    device = simulated_device(config, 1)
    client = ModbusClient(device.transport())
    client.clock.sleep_until(2.0)
    device.faults.drop()
    client.broadcast(requests.write_register(48, 700), TIMING)
    with pytest.raises(DeadlineError):
        client.execute(1, requests.read_holding(48, 1), TIMING)
    assert requests.registers_of(client.execute(1, requests.read_holding(48, 1), TIMING)) == (700,)
