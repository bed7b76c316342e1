"""Modbus TCP: replies count by their transaction number; sockets tell what is wrong and how to cure it."""

import socket
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU

from smadrive.clock import VirtualClock
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import mbap, requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.connect import open_transport
from smadrive.modbus.inprocess import InProcessTransport
from smadrive.modbus.master import Master

READ = requests.read_holding(10, 2)
RIGHT = bytes.fromhex("03 04 000A 000B")
TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)


@pytest.fixture
def tcp(script):
    def make(*answers):
        return Master(InProcessTransport(script(*answers), VirtualClock(), baudrate=None))

    return make


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.binary(min_size=1, max_size=200))
def test_frames_agree_with_pymodbus(transaction, unit_id, pdu):
    theirs = FramerSocket(DecodePDU(is_server=False)).encode(pdu, unit_id, transaction)
    assert mbap.seal(transaction, unit_id, pdu) == theirs
    assert mbap.frame_size(theirs) == len(theirs)


def test_a_right_reply_in_pieces_is_put_together(tcp):
    frame = mbap.seal(1, 1, RIGHT)
    master = tcp([(0.01, frame[:3]), (0.02, frame[3:9]), (0.03, frame[9:])])
    assert requests.registers_of(master.execute(1, READ, TIMING)) == (10, 11)


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (mbap.seal(1, 2, RIGHT), "the right one starts 01 03 04"),
        (mbap.seal(1, 1, b"\x04" + RIGHT[1:]), "the right one starts 01 03 04"),
        (mbap.seal(1, 1, RIGHT[:-2]), "5 bytes, the right reply has 7"),
        (mbap.seal(1, 1, RIGHT + b"\0"), "8 bytes, the right reply has 7"),
        (mbap.seal(1, 1, RIGHT[:1]), "the reply starts 01 03"),
        (mbap.seal(1, 1, b"\x83"), "2 bytes, the right reply has 3"),
        (bytes.fromhex("0001 0005 0007 01") + RIGHT, r"no Modbus TCP frame \(protocol 5"),
        (bytes.fromhex("0001 0000 0FFF 01") + RIGHT, r"no Modbus TCP frame .*write rtu\+tcp://"),
    ],
    ids=["unit", "function", "short", "long", "head", "exception", "protocol", "length"],
)
def test_a_wrong_reply_is_refused_at_once(tcp, frame, says):
    master = tcp([(0.0, frame)])
    with pytest.raises(ProtocolError, match=says):
        master.execute(1, READ, TIMING)
    assert master.clock.now_s() < TIMING.response_timeout_s


def test_a_reply_with_another_number_is_dropped_and_the_right_one_behind_it_taken(tcp):
    stale = mbap.seal(0xFFFF, 1, bytes.fromhex("03 04 DEAD DEAD"))
    master = tcp([(0.0, stale + mbap.seal(1, 1, RIGHT))])
    assert requests.registers_of(master.execute(1, READ, TIMING)) == (10, 11)
    assert master.transport.framing.dropped == 1
    with pytest.raises(DeadlineError):
        tcp([(0.0, stale)]).execute(1, READ, TIMING)


def test_a_refusal_carries_its_code(tcp):
    with pytest.raises(ExceptionReply, match="gateway target did not respond"):
        tcp([(0.0, mbap.seal(1, 1, b"\x83\x0b"))]).execute(1, READ, TIMING)


@pytest.mark.parametrize("left", [mbap.seal(1, 1, RIGHT)[:8], bytes.fromhex("00 01 00 05 00 07 01")])
def test_a_stream_out_of_step_is_opened_anew(tcp, left):
    """What follows half a frame could be cut into a frame that nobody sent."""
    master = tcp([(0.0, left)], [(0.0, mbap.seal(2, 1, RIGHT))])
    with pytest.raises((DeadlineError, ProtocolError)):
        master.execute(1, READ, TIMING)
    assert requests.registers_of(master.execute(1, READ, TIMING)) == (10, 11)
    assert master.counters.reopenings == 1


class Registers:
    """Register n holds n; it answers in order, each reply later by the next of `delays_s`."""

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
def test_a_late_reply_never_answers_another_request(delays_s, asked):
    master = Master(InProcessTransport(Registers(delays_s), VirtualClock(), baudrate=None))
    for first, count in asked:
        try:
            payload = master.execute(1, requests.read_holding(first, count), BusTiming(0.1, read_retries=1))
        except DeadlineError:
            continue
        assert requests.registers_of(payload) == tuple(range(first, first + count))


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
        with pytest.raises(TransportError, match=r"connection is lost .*closed by the far end"):
            transport.read(transport.clock.now_s() + 5)
    with pytest.raises(TransportError, match="connection is lost"):
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
        payload = Master(transport).execute(1, requests.read_holding(0, 2), BusTiming(2.0))
    thread.join()
    assert requests.registers_of(payload) == (500, 5000)


def test_what_does_not_open_is_told_with_its_cure(listener):
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(TransportError, match="refused: nobody listens there; check the port"):
        open_transport(f"tcp://127.0.0.1:{port}")
    with pytest.raises(TransportError, match=r"no host of the name 'no-such-host.invalid' is known"):
        open_transport("tcp://no-such-host.invalid")
