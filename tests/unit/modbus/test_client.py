"""The client accepts no wrong reply: neither a damaged nor a foreign nor a late reply."""

import errno
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smadrive.clock import VirtualClock
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.in_process import InProcessTransport

READ = requests.read_holding(10, 4)
RIGHT = rtu.seal(1, bytes.fromhex("03 08 000A 000B 000C 000D"))


def test_a_right_reply_in_pieces_is_put_together(bus, script, timing):
    client = bus(script([(0.01, RIGHT[:1]), (0.02, RIGHT[1:6]), (0.03, RIGHT[6:])]))
    assert requests.registers_of(client.execute(1, READ, timing)) == (10, 11, 12, 13)
    assert client.counters.replies == 1


@pytest.mark.parametrize(
    ("wrong", "counted"),
    [
        (rtu.seal(2, RIGHT[1:-2]), "wrong_replies"),
        (rtu.seal(1, b"\x04" + RIGHT[2:-2]), "wrong_replies"),
        (rtu.seal(1, bytes.fromhex("03 04 000A 000B")), "wrong_replies"),
        (b"\xff\x00\x37" + RIGHT, "wrong_replies"),
        (RIGHT[:-1] + b"\x00", "crc_errors"),
        (RIGHT[:4] + b"\x99" + RIGHT[5:], "crc_errors"),
        (RIGHT + b"\x00", "wrong_replies"),
        (RIGHT + RIGHT, "wrong_replies"),
        (bytes.fromhex("01 83 02 00 00"), "crc_errors"),
        (bytes.fromhex("01 90 02") + rtu.crc(bytes.fromhex("01 90 02")), "wrong_replies"),
    ],
    ids=["unit", "function", "count", "junk", "crc", "payload", "tail", "twice", "exception crc", "foreign exception"],
)
def test_wrong_reply_is_rejected_at_once(bus, script, timing, wrong, counted):
    client = bus(script([(0.0, wrong)]))
    before_s = client.clock.now_s()
    with pytest.raises(ProtocolError):
        client.execute(1, READ, timing)
    assert client.clock.now_s() - before_s < timing.response_timeout_s
    assert getattr(client.counters, counted) == 1


def test_silence_is_a_missed_deadline(bus, script, timing):
    client = bus(script())
    before_s = client.clock.now_s()
    with pytest.raises(DeadlineError):
        client.execute(1, READ, timing)
    on_wire_s = (8 + 13) * 11 / 115200
    assert client.clock.now_s() - before_s == pytest.approx(on_wire_s + timing.response_timeout_s)


def test_half_a_reply_is_a_missed_deadline(bus, script, timing):
    with pytest.raises(DeadlineError) as error:
        bus(script([(0.0, RIGHT[:6])])).execute(1, READ, timing)
    assert error.value.value == "6 bytes"


def test_exception_reply_has_code_and_meaning(bus, script, timing):
    client = bus(script([(0.0, rtu.seal(1, b"\x83\x02"))]))
    with pytest.raises(ExceptionReply) as refused:
        client.execute(1, READ, timing)
    assert refused.value.code == 2
    assert refused.value.value == "exception 2, illegal data address"
    assert refused.value.where.endswith("unit 1, function 3 at 10")
    assert client.counters.exceptions == 1


def refused(function, code):
    return rtu.seal(1, bytes((function | 0x80, code)))


def read_of(first, count):
    """Return the reply of a device whose register n holds n."""
    words = b"".join(register.to_bytes(2, "big") for register in range(first, first + count))
    return rtu.seal(1, bytes((3, 2 * count)) + words)


def test_late_exception_is_rejected_and_leaves_no_lag(bus, slow_registers, timing):
    """The exception to the first request arrives during the wait for the second reply, which has another length."""

    class Refuses(type(slow_registers())):
        def receive(self, data, time_s):
            if int.from_bytes(data[2:4], "big") != 99:
                return super().receive(data, time_s)
            self.busy_until_s = max(time_s, self.busy_until_s) + 0.3
            return [(self.busy_until_s, refused(3, 6))]

    client = bus(Refuses())
    with pytest.raises(DeadlineError):
        client.execute(1, requests.read_holding(99, 3), timing)
    read = []
    for first in range(100, 140):
        try:
            payload = client.execute(1, requests.read_holding(first, 2), timing)
        except (DeadlineError, ProtocolError):
            continue
        read.append((first, *requests.registers_of(payload)))
    assert read == [(first, first, first + 1) for first, *_ in read]
    assert len(read) >= 38
    assert client.counters.exceptions == 0


@pytest.mark.parametrize("code", [5, 6, 10, 11])
def test_reply_after_an_exception_is_rejected(bus, slow_registers, timing, code):
    class AnswersAfterAll(type(slow_registers())):
        def receive(self, data, time_s):
            ((due_s, reply),) = super().receive(data, time_s)
            return [(time_s, refused(3, code)), (due_s + 0.01, reply)] if data[3] == 99 else [(due_s, reply)]

    client = bus(AnswersAfterAll())
    with pytest.raises(ExceptionReply) as refusal:
        client.execute(1, requests.read_holding(99, 4), timing)
    assert refusal.value.code == code
    for first in range(20, 40):
        try:
            payload = client.execute(1, requests.read_holding(first, 4), timing)
        except ProtocolError:
            continue
        assert requests.registers_of(payload) == tuple(range(first, first + 4))
    assert first == 39
    assert client.counters.replies > 18


def test_second_copy_of_an_exception_leaves_no_lag(bus, slow_registers, timing):
    """The copy may answer the next request. The real reply to this request then arrives during the request after it."""

    class RefusesTwice(type(slow_registers())):
        def receive(self, data, time_s):
            if data[3] != 99:
                return super().receive(data, time_s)
            return [(time_s, refused(3, 2)), (time_s + 0.01, refused(3, 2))]

    client = bus(RefusesTwice([0.02] * 100))
    with pytest.raises(ExceptionReply):
        client.execute(1, requests.read_holding(99, 4), timing)
    right = 0
    for first in range(20, 40):
        try:
            payload = client.execute(1, requests.read_holding(first, 4), timing)
        except (ProtocolError, ExceptionReply):
            continue
        assert requests.registers_of(payload) == tuple(range(first, first + 4))
        right += 1
    assert right >= 17


def test_second_copy_of_a_reply_is_rejected_by_a_proved_read(bus, timing):
    """The copy arrives after the next request was sent. Only the answer to a request of another kind reveals that."""

    class Doubles:
        reads = 0

        def receive(self, data, time_s):
            self.reads += 1
            count = data[5]
            reply = rtu.seal(1, bytes((3, 2 * count)) + self.reads.to_bytes(2, "big") * count)
            return [(time_s, reply), (time_s + 0.02, reply)] if self.reads == 2 else [(time_s + 0.03, reply)]

    far = Doubles()
    client = bus(far)
    for proved in (False, False, True):
        last = None
        while last is None:
            try:
                last = requests.registers_of(client.execute(1, READ, timing, proved=proved))
            except ProtocolError:
                continue
    assert last == (far.reads,) * 4


def test_proved_read_works_with_a_device_that_knows_no_other_request(bus, script, timing):
    far = script([], [(0.0, RIGHT)])
    assert bus(far).execute(1, READ, timing, proved=True) == RIGHT[3:-2]
    assert len(far.heard) == 2


def test_failing_trace_does_not_stop_the_frames(bus, script, timing):
    def trace(*_event):
        raise OSError(errno.ENOSPC, "No space left on device")

    far = script([(0.0, RIGHT)], [(0.0, RIGHT)])
    client = bus(far, trace=trace)
    for _ in range(2):
        assert client.execute(1, READ, timing) == RIGHT[3:-2]
    assert isinstance(client.trace.failure, OSError)
    assert len(far.heard) == 2


@given(
    delays_s=st.lists(st.floats(0.0, 4.0), min_size=1, max_size=12),
    asked=st.lists(st.tuples(st.integers(0, 50), st.integers(1, 3)), min_size=5, max_size=20),
)
@settings(max_examples=300, deadline=None)
def test_late_reply_is_rejected(slow_registers_class, check_reads, delays_s, asked):
    client = ModbusClient(InProcessTransport(slow_registers_class(delays_s), VirtualClock()))
    check_reads(client, asked)


def test_reply_150_ms_late_is_discarded_and_the_next_read_is_right(bus, slow_registers, timing):
    client = bus(slow_registers([0.25]))
    with pytest.raises(DeadlineError):
        client.execute(1, requests.read_holding(10, 4), timing)
    for first in (500, 700):
        payload = client.execute(1, requests.read_holding(first, 4), timing)
        assert requests.registers_of(payload) == tuple(range(first, first + 4))
    assert client.counters.quarantines >= 1
    assert client.counters.probes == 2  # the first probe met the late reply


def test_replies_of_a_device_that_hung_are_rejected(bus, slow_registers, timing):
    client = bus(slow_registers([0.001, 3.0]))
    client.execute(1, requests.read_holding(0, 2), timing)
    outcomes = []
    for first in range(100, 150):
        try:
            outcomes.append(
                requests.registers_of(client.execute(1, requests.read_holding(first, 1), timing))[0] == first
            )
        except (DeadlineError, ProtocolError):
            outcomes.append(None)
    assert set(outcomes[:10]) == {None}
    assert set(outcomes[-5:]) == {True}
    assert False not in outcomes


def test_device_silent_on_unknown_requests_is_probed_with_known_ones(bus, timing):
    class Shy:
        known = (requests.read_holding(0, 1), requests.read_holding(4, 2))
        lost = 0

        def receive(self, data, time_s):
            answers = {
                rtu.seal(1, one.pdu): bytes((3, one.payload_size)) + bytes(one.payload_size) for one in self.known
            }
            self.lost -= 1
            return [] if self.lost == 0 or data not in answers else [(time_s, rtu.seal(1, answers[data]))]

    far = Shy()
    client = bus(far)
    for one in far.known:
        client.execute(1, one, timing)
    far.lost = 1
    with pytest.raises(DeadlineError):
        client.execute(1, far.known[0], timing)
    assert client.execute(1, far.known[0], timing) == b"\0\0"


def test_a_write_after_a_lost_read_needs_no_probe(bus, script, timing):
    write = requests.write_register(5, 1)
    far = script([], [(0.0, rtu.seal(1, write.pdu))])
    client = bus(far)
    with pytest.raises(DeadlineError):
        client.execute(1, READ, timing)
    client.execute(1, write, timing)
    assert len(far.heard) == 2
    assert far.heard[1][0] - far.heard[0][0] >= 2 * timing.response_timeout_s


def test_reads_are_retried_and_writes_are_not(bus, script):
    patient = BusTiming(0.1, read_retries=2)
    far = script([], [], [(0.0, RIGHT)])
    far.answers.insert(1, [(0.0, rtu.seal(1, bytes.fromhex("03 02 000A")))])  # answers the probe
    far.answers.insert(3, [(0.0, rtu.seal(1, bytes.fromhex("03 02 000A")))])
    client = bus(far)
    assert requests.registers_of(client.execute(1, READ, patient)) == (10, 11, 12, 13)
    assert client.counters.retries == 2

    far = script()
    with pytest.raises(DeadlineError):
        bus(far).execute(1, requests.write_register(5, 1), patient)
    assert len(far.heard) == 1


def test_unrequested_bytes_lead_to_quarantine(bus, script, timing):
    far = script([(0.0, RIGHT), (0.01, b"\x55\x55")], [(0.0, RIGHT)])
    client = bus(far)
    client.execute(1, READ, timing)
    client.clock.sleep_until(client.clock.now_s() + 0.02)
    client.execute(1, READ, timing)
    assert client.counters.discarded_bytes == 2
    assert far.heard[1][0] - far.heard[0][0] >= timing.response_timeout_s


def test_new_client_first_listens_for_replies_to_another_one(script, timing):
    late = rtu.seal(1, bytes.fromhex("03 08 0063 0063 0063 0063"))
    far = script([(0.0, RIGHT)])
    transport = InProcessTransport(far, VirtualClock())
    transport.deliver(0.05, late)
    client = ModbusClient(transport)
    assert requests.registers_of(client.execute(1, READ, timing)) == (10, 11, 12, 13)
    assert client.counters.discarded_bytes == len(late)
    assert far.heard[0][0] == pytest.approx(0.05 + timing.response_timeout_s)


def test_a_lost_connection_is_opened_again_by_the_next_request(bus, script, timing):
    far = script([(0.0, RIGHT)], [(0.3, RIGHT), (0.31, b"\x55")])
    client = bus(far)
    client.execute(1, READ, timing)
    client.transport.disconnect(return_s=client.clock.now_s() + 1.0)
    with pytest.raises(TransportError) as error:
        client.execute(1, READ, timing)
    assert error.value.where == "in process"
    client.clock.sleep_until(client.clock.now_s() + 1.0)
    reopened_s = client.clock.now_s()
    with pytest.raises(DeadlineError):
        client.execute(1, READ, timing)
    assert far.heard[1][0] == pytest.approx(reopened_s + timing.response_timeout_s)
    assert client.counters.reopenings == 1


def test_a_request_that_is_bound_to_a_lost_connection_is_not_sent_on_the_next(bus, script, timing):
    far = script([(0.0, RIGHT)], [(0.0, RIGHT)])
    client = bus(far)
    known = client.connection
    client.execute(1, READ, timing, known)
    client.transport.disconnect()
    with pytest.raises(TransportError):
        client.execute(1, READ, timing, known)
    assert len(far.heard) == 1
    assert client.execute(1, READ, timing, client.connection)


def test_bus_that_is_never_silent_is_an_error(bus, script, timing):
    client = bus(script([(0.01 * i, b"\x00") for i in range(1000)]))
    with pytest.raises(ProtocolError):
        client.execute(1, READ, timing)
    with pytest.raises(TransportError) as error:
        client.execute(1, READ, timing)
    assert error.value.where == client.transport.name


def test_a_broadcast_waits_for_no_reply(bus, script, timing):
    far = script()
    bus(far).broadcast(requests.write_register(5, 1), timing)
    assert far.heard[0][1] == rtu.seal(0, bytes.fromhex("06 0005 0001"))


def test_the_trace_sees_every_byte(bus, script, timing):
    seen = []
    bus(script([(0.0, RIGHT)]), trace=lambda *event: seen.append(event[1:])).execute(1, READ, timing)
    assert seen == [("sent", rtu.seal(1, READ.pdu)), ("received", RIGHT)]


def test_a_distrusted_bus_is_quarantined(bus, script, timing):
    shorter = (0.0, rtu.seal(1, bytes.fromhex("03 02 000A")))
    far = script([(0.0, RIGHT)], [shorter], [(0.0, RIGHT)])
    client = bus(far)
    client.execute(1, READ, timing)
    client.distrust()
    client.execute(1, READ, timing)
    assert far.heard[1][0] - far.heard[0][0] >= timing.response_timeout_s
    assert far.heard[1][1] == rtu.seal(1, requests.read_holding(10, 1).pdu)


def test_the_reply_to_an_interrupted_request_answers_no_other(bus, slow_registers, timing):
    client = bus(slow_registers([0.05]))

    def interrupt(_time_s):
        raise KeyboardInterrupt

    followers = client.clock._followers
    client.execute(1, requests.read_holding(0, 1), timing)
    followers.append(interrupt)
    client.transport._peer.delays_s = [0.05]
    client._line._free_at_s -= 1  # no pause is left: the interrupt comes during the wait for the reply
    with pytest.raises(KeyboardInterrupt):
        client.execute(1, requests.read_holding(10, 2), timing)
    followers.clear()
    assert requests.registers_of(client.execute(1, requests.read_holding(20, 2), timing)) == (20, 21)


def test_threads_take_turns(bus, slow_registers, timing):
    client = bus(slow_registers())

    def read(first):
        return requests.registers_of(client.execute(1, requests.read_holding(first, 2), timing))

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(read, range(200))) == [(first, first + 1) for first in range(200)]


def test_closed_transport_is_not_opened_again(bus, script, timing):
    client = bus(script())
    client.transport.close()
    with pytest.raises(TransportError) as error:
        client.execute(1, READ, timing)
    assert error.value.cure == "open a new connection"
    assert client.transport.lost


def test_a_connection_may_delay_a_reply_by_its_latency(slow_registers_class, timing):
    client = ModbusClient(InProcessTransport(slow_registers_class([0.25, 0.35]), VirtualClock(), latency_s=0.2))
    request = requests.read_holding(7, 1)
    assert requests.registers_of(client.execute(1, request, timing)) == (7,)
    with pytest.raises(DeadlineError):
        client.execute(1, request, timing)
