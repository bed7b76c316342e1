"""On Modbus TCP the transaction number assigns a reply to its request. Socket errors have a cure."""

import socket
import threading
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU

from smadrive.clock import VirtualClock
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import mbap
from smadrive.modbus.framing.framing import NEAR, REMEMBERED, TcpFraming
from smadrive.modbus.transports.connect import open_transport
from smadrive.modbus.transports.in_process import InProcessTransport

READ = requests.read_holding(10, 2)
RIGHT = bytes.fromhex("03 04 000A 000B")
TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)


class Script:
    """Answers request n with `answers[n]`, a list of (delay in seconds, bytes or a function of the number)."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.numbers = []

    def receive(self, data, time_s):
        number = mbap.Header.of(data).transaction
        self.numbers.append(number)
        answer = self.answers.pop(0) if self.answers else []
        return [(time_s + delay_s, reply(number) if callable(reply) else reply) for delay_s, reply in answer]


def numbered(pdu, unit_id=1, ahead=0):
    return lambda number: mbap.seal((number + ahead) & 0xFFFF, unit_id, pdu)


@pytest.fixture
def tcp():
    def make(*answers):
        return ModbusClient(InProcessTransport(Script(*answers), VirtualClock(), baudrate=None))

    return make


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.binary(min_size=1, max_size=200))
def test_frames_agree_with_pymodbus(transaction, unit_id, pdu):
    theirs = FramerSocket(DecodePDU(is_server=False)).encode(pdu, unit_id, transaction)
    assert mbap.seal(transaction, unit_id, pdu) == theirs
    assert mbap.frame_size(theirs) == len(theirs)


def test_a_right_reply_in_pieces_is_put_together(tcp):
    whole = numbered(RIGHT)
    pieces = [(0.01, slice(0, 3)), (0.02, slice(3, 9)), (0.03, slice(9, None))]
    client = tcp([(delay_s, lambda number, part=part: whole(number)[part]) for delay_s, part in pieces])
    assert requests.registers_of(client.execute(1, READ, TIMING)) == (10, 11)


@pytest.mark.parametrize(
    "frame",
    [
        numbered(RIGHT, unit_id=2),
        numbered(b"\x04" + RIGHT[1:]),
        numbered(RIGHT[:-2]),
        numbered(RIGHT + b"\0"),
        numbered(RIGHT[:1]),
        numbered(b"\x83"),
        bytes.fromhex("0001 0005 0007 01") + RIGHT,
        bytes.fromhex("0001 0000 0FFF 01") + RIGHT,
    ],
    ids=["unit", "function", "short", "long", "head", "exception", "protocol", "length"],
)
def test_wrong_reply_is_rejected_at_once(tcp, frame):
    client = tcp([(0.0, frame)])
    with pytest.raises(ProtocolError):
        client.execute(1, READ, TIMING)
    assert client.clock.now_s() < TIMING.response_timeout_s
    assert client.counters.wrong_replies == 1


def test_reply_with_another_number_is_dropped(tcp):
    stale = numbered(bytes.fromhex("03 04 DEAD DEAD"), ahead=-1)
    client = tcp([(0.0, lambda number: stale(number) + numbered(RIGHT)(number))])
    assert requests.registers_of(client.execute(1, READ, TIMING)) == (10, 11)
    assert client.transport.framing.dropped == 1
    with pytest.raises(DeadlineError):
        tcp([(0.0, stale)]).execute(1, READ, TIMING)


@pytest.mark.parametrize("delay_s", [0.0, 0.02], ids=["before the request", "before the reply"])
def test_early_reply_with_the_next_number_is_rejected(tcp, delay_s):
    early = numbered(bytes.fromhex("03 04 DEAD DEAD"), ahead=1)
    client = tcp([(0.0, numbered(RIGHT)), (delay_s, early)], [(0.05, numbered(RIGHT))])
    for _ in range(2):
        assert requests.registers_of(client.execute(1, READ, TIMING)) == (10, 11)
    assert client.transport.framing.dropped == 1


def test_bytes_before_the_request_are_discarded(tcp):
    framing = TcpFraming(Random(1))
    framing.skip(b"".join(mbap.seal(number, 1, RIGHT) for number in range(100)))
    assert framing.dropped == 100
    assert not framing.out_of_step
    client = tcp([(0.0, numbered(RIGHT)), (0.0, b"\x55")], [(0.0, numbered(RIGHT))])
    for _ in range(2):
        assert requests.registers_of(client.execute(1, READ, TIMING)) == (10, 11)
    assert client.counters.discarded_bytes == 1
    assert client.counters.reopenings == 1  # after half a frame, the beginning of the next one is unknown


def test_transaction_numbers_are_random_and_not_near_the_last():
    framing = TcpFraming(Random(1))
    numbers = [mbap.Header.of(framing.request(1, READ.pdu)).transaction for _ in range(REMEMBERED)]
    assert len(set(numbers)) == REMEMBERED
    steps = [(after - before) & 0xFFFF for before, after in pairwise(numbers)]
    assert min(steps) > NEAR
    assert max(steps) < 0x10000 - NEAR


def test_exception_reply_has_its_code(tcp):
    with pytest.raises(ExceptionReply) as refusal:
        tcp([(0.0, numbered(b"\x83\x0b"))]).execute(1, READ, TIMING)
    assert refusal.value.code == 0x0B


@pytest.mark.parametrize("left", [lambda number: numbered(RIGHT)(number)[:8], bytes.fromhex("00 01 00 05 00 07 01")])
def test_a_stream_out_of_step_is_opened_anew(tcp, left):
    """Otherwise bytes behind half a frame could be read as a frame that was never sent."""
    client = tcp([(0.0, left)], [(0.0, numbered(b"\x03\x02\0\0"))], [(0.0, numbered(RIGHT))])
    with pytest.raises((DeadlineError, ProtocolError)):
        client.execute(1, READ, TIMING)
    assert requests.registers_of(client.execute(1, READ, TIMING)) == (10, 11)
    assert client.counters.reopenings == 1


class Registers:
    """A slow device whose register n holds n. It answers in order; `delays_s` are the delays of its replies."""

    def __init__(self, delays_s):
        self.delays_s = list(delays_s)
        self.busy_until_s = 0.0

    def receive(self, data, time_s):
        header = mbap.Header.of(data)
        first, count = int.from_bytes(data[8:10], "big"), int.from_bytes(data[10:12], "big")
        words = b"".join(register.to_bytes(2, "big") for register in range(first, first + count))
        self.busy_until_s = max(time_s, self.busy_until_s) + (self.delays_s.pop(0) if self.delays_s else 0.001)
        frame = mbap.seal(header.transaction, 1, bytes((3, len(words))) + words)
        return [(self.busy_until_s, frame[:5]), (self.busy_until_s, frame[5:])]


@given(
    delays_s=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12),
    asked=st.lists(st.tuples(st.integers(0, 50), st.integers(1, 3)), min_size=5, max_size=20),
)
@settings(max_examples=200, deadline=None)
def test_late_reply_is_rejected(check_reads, delays_s, asked):
    client = ModbusClient(InProcessTransport(Registers(delays_s), VirtualClock(), baudrate=None))
    check_reads(client, asked)


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_a_connection_that_the_far_end_closes_is_lost(listener):
    with open_transport(f"tcp://127.0.0.1:{listener.getsockname()[1]}") as transport:
        far, _ = listener.accept()
        far.sendall(b"abc")
        assert transport.read(transport.clock.now_s() + 5) == b"abc"
        assert transport.read(transport.clock.now_s()) == b""
        far.close()
        with pytest.raises(TransportError) as error:
            transport.read(transport.clock.now_s() + 5)
        assert str(error.value.value) == transport.end
        assert transport.lost
    with pytest.raises(TransportError):
        transport.write(b"x")


def test_rtu_frames_pass_through_a_gateway(listener):
    def gateway():
        far, _ = listener.accept()
        with far:
            assert far.recv(100) == bytes.fromhex("01 03 00 00 00 02 C4 0B")
            far.sendall(bytes.fromhex("01 03 04 01 F4 13 88 B7 6B"))

    thread = threading.Thread(target=gateway)
    thread.start()
    with open_transport(f"rtu+tcp://127.0.0.1:{listener.getsockname()[1]}?baudrate=9600") as transport:
        assert transport.baudrate == 9600
        payload = ModbusClient(transport).execute(1, requests.read_holding(0, 2), BusTiming(2.0))
    thread.join()
    assert requests.registers_of(payload) == (500, 5000)


def test_connection_that_does_not_open_has_a_cure(listener):
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(TransportError) as refused:
        open_transport(f"tcp://127.0.0.1:{port}")
    assert refused.value.where == f"127.0.0.1:{port}"
    assert refused.value.cure.startswith("check the port")
    with pytest.raises(TransportError) as unknown:
        open_transport("tcp://no-such-host.invalid")
    assert unknown.value.value == "no-such-host.invalid"
