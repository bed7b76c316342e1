"""The client's protocol without I/O. Every cell of its tables is tested."""

import pytest

from smadrive.modbus import requests
from smadrive.modbus.framing import mbap, rtu
from smadrive.modbus.framing.framing import RtuFraming, TcpFraming
from smadrive.modbus.outstanding import LATEST_REPLY_S
from smadrive.modbus.protocol import ClientProtocol
from smadrive.modbus.verdict import CONSEQUENCES, FINAL_CODES, TRANSITIONS, ConnectionEvent, ConnectionState, Verdict

READ = requests.read_holding(10, 2)
SAME_KIND = requests.read_holding(500, 2)
SAME_FUNCTION = requests.read_holding(500, 7)
ANOTHER_FUNCTION = requests.read_input(10, 3)
OUTSTANDING = {"nothing": None, "reply": SAME_KIND, "exception": SAME_FUNCTION, "another": ANOTHER_FUNCTION}
PDUS = {
    "reply": bytes.fromhex("03 04 000A 000B"),
    "exception": bytes.fromhex("83 02"),
    "deferral": bytes.fromhex("83 06"),
    "foreign": bytes.fromhex("04 04 000A 000B"),
    "foreign exception": bytes.fromhex("84 02"),
    "too long": bytes.fromhex("03 04 000A 000B 000C"),
}
VERDICTS = {  # by the frame that arrives, one verdict for each of OUTSTANDING; SAME_KIND includes an exception
    "reply": (Verdict.ANSWERED, Verdict.STALE, Verdict.ANSWERED, Verdict.ANSWERED),
    "exception": (Verdict.REFUSED, Verdict.STALE, Verdict.STALE, Verdict.REFUSED),
    "deferral": (Verdict.DEFERRED, Verdict.STALE, Verdict.STALE, Verdict.DEFERRED),
    "foreign": (Verdict.FOREIGN,) * 4,
    "foreign exception": (Verdict.FOREIGN,) * 4,
    "too long": (Verdict.WRONG_SIZE,) * 4,
    "damaged": (Verdict.DAMAGED,) * 4,
    "half a reply": (Verdict.SILENT,) * 4,
    "nothing": (Verdict.SILENT,) * 4,
}
CELLS = [
    (outstanding, arrives, verdict)
    for arrives, row in VERDICTS.items()
    for outstanding, verdict in zip(OUTSTANDING, row, strict=True)
]


def ready():
    protocol = ClientProtocol(RtuFraming())
    protocol.silence()
    return protocol


def rtu_frame(arrives):
    match arrives:
        case "nothing":
            return b""
        case "half a reply":
            return rtu.seal(1, PDUS["reply"])[:5]
        case "damaged":
            return rtu.seal(1, PDUS["reply"])[:-1] + b"\0"
    return rtu.seal(1, PDUS[arrives])


def outcome_of(protocol, request, data, now_s=1.0):
    protocol.send(1, request)
    outcome = protocol.receive(data, now_s) if data else None
    return outcome or protocol.give_up(now_s)


def unanswered(protocol, request, now_s=0.0):
    protocol.send(1, request)
    protocol.give_up(now_s)
    protocol.silence()


@pytest.mark.parametrize(("outstanding", "arrives", "verdict"), CELLS)
def test_the_verdict_on_rtu(outstanding, arrives, verdict):
    protocol = ready()
    if OUTSTANDING[outstanding] is not None:
        unanswered(protocol, OUTSTANDING[outstanding])
    outcome = outcome_of(protocol, READ, rtu_frame(arrives))
    assert outcome.verdict is verdict
    if verdict is Verdict.ANSWERED:
        assert requests.registers_of(outcome.data) == (10, 11)
    if arrives == "exception":
        assert outcome.code == 2


@pytest.mark.parametrize(("outstanding", "arrives", "verdict"), CELLS)
def test_the_verdict_on_tcp(outstanding, arrives, verdict):
    """As on RTU, but the transaction number proves an exception, and TCP detects damage."""
    if arrives in ("damaged", "half a reply", "nothing"):
        return
    protocol = ClientProtocol(TcpFraming())
    if OUTSTANDING[outstanding] is not None:
        protocol.send(1, OUTSTANDING[outstanding])
        protocol.give_up(0.0)
    number = mbap.Header.of(protocol.send(1, READ)).transaction
    outcome = protocol.receive(mbap.seal(number, 1, PDUS[arrives]), 1.0)
    numbered = {"exception": Verdict.REFUSED, "deferral": Verdict.DEFERRED}
    assert outcome.verdict is numbered.get(arrives, verdict)


def test_bytes_that_are_not_modbus_tcp_need_a_new_connection():
    protocol = ClientProtocol(TcpFraming())
    protocol.send(1, READ)
    assert protocol.receive(rtu.seal(1, PDUS["reply"]), 0.0).verdict is Verdict.MALFORMED
    assert protocol.state is ConnectionState.OUT_OF_STEP
    protocol.new_connection()
    assert protocol.state is ConnectionState.READY


def test_bytes_after_an_incomplete_frame_leave_the_need_for_a_new_connection():
    """They may arrive when a signal has interrupted the exchange before the connection was closed."""
    protocol = ClientProtocol(TcpFraming())
    protocol.send(1, READ)
    protocol.receive(b"\x13\x88", 0.0)
    protocol.give_up(1.0)
    protocol.stray(b"\x00")
    assert protocol.state is ConnectionState.OUT_OF_STEP


class Drawn:
    """A random generator that returns these numbers in turn."""

    def __init__(self, *numbers):
        self._numbers = iter(numbers)

    def getrandbits(self, _bits):
        return next(self._numbers)


def test_frame_behind_a_reply_does_not_answer_the_next_request():
    """The frame has the transaction number that the next request will get."""
    early, reply = mbap.seal(5000, 1, bytes.fromhex("03 04 DEAD DEAD")), mbap.seal(1000, 1, PDUS["reply"])
    protocol = ClientProtocol(TcpFraming(Drawn(0, 1000, 5000)))
    assert outcome_of(protocol, READ, reply + early).verdict is Verdict.ANSWERED
    assert outcome_of(protocol, READ, mbap.seal(5000, 1, PDUS["reply"])).data == PDUS["reply"][2:]


def test_half_a_frame_behind_a_reply_needs_a_new_connection():
    protocol = ClientProtocol(TcpFraming(Drawn(0, 1000)))
    assert outcome_of(protocol, READ, mbap.seal(1000, 1, PDUS["reply"]) + b"\x13\x88").verdict is Verdict.ANSWERED
    assert protocol.state is ConnectionState.OUT_OF_STEP
    protocol.distrust(1.0)
    assert protocol.state is ConnectionState.OUT_OF_STEP


@pytest.mark.parametrize("arrives", VERDICTS)
def test_outstanding_frames_after_each_verdict(arrives):
    """The test counts frames of the request itself and of an older request to the same unit."""
    protocol = ready()
    unanswered(protocol, ANOTHER_FUNCTION)
    verdict = outcome_of(protocol, READ, rtu_frame(arrives)).verdict
    consequence = CONSEQUENCES[verdict]
    assert protocol.may_be_mistaken(1, READ, 2.0) is consequence.reply_remains
    assert protocol.may_be_mistaken(1, ANOTHER_FUNCTION, 2.0) is not consequence.proves
    assert protocol.state is (
        ConnectionState.READY if consequence.event is ConnectionEvent.DONE else ConnectionState.SUSPECT
    )
    protocol.silence()
    exception = outcome_of(protocol, SAME_FUNCTION, rtu.seal(1, b"\x83\x02")).verdict
    assert (exception is Verdict.STALE) is consequence.exception_remains


@pytest.mark.parametrize("code", range(1, 12))
def test_final_exception_clears_outstanding_replies(code):
    protocol = ready()
    unanswered(protocol, ANOTHER_FUNCTION)
    outcome = outcome_of(protocol, READ, rtu.seal(1, bytes((0x83, code))))
    assert outcome.verdict is (Verdict.REFUSED if code in FINAL_CODES else Verdict.DEFERRED)
    assert outcome.code == code
    assert protocol.may_be_mistaken(1, ANOTHER_FUNCTION, 2.0) is (code not in FINAL_CODES)


def test_reply_of_another_unit_stays_outstanding():
    protocol = ready()
    protocol.send(2, READ)
    protocol.give_up(0.0)
    protocol.silence()
    assert outcome_of(protocol, READ, rtu_frame("reply")).verdict is Verdict.ANSWERED
    assert protocol.may_be_mistaken(2, READ, 2.0)


def test_outstanding_reply_expires():
    protocol = ready()
    unanswered(protocol, READ, now_s=0.0)
    assert protocol.may_be_mistaken(1, READ, 0.99 * LATEST_REPLY_S)
    assert not protocol.may_be_mistaken(1, READ, LATEST_REPLY_S)


def test_every_state_has_a_transition_for_each_possible_event():
    """A request is sent only in READY. Silence, strays and new connections may come at any time between requests."""
    assert {state for state, event in TRANSITIONS if event is ConnectionEvent.SENT} == {ConnectionState.READY}
    assert {state for state, event in TRANSITIONS if event is ConnectionEvent.DONE} == {ConnectionState.WAITING}
    for event in (ConnectionEvent.STRAY, ConnectionEvent.SILENCE, ConnectionEvent.FAILED):
        assert {ConnectionState.READY, ConnectionState.SUSPECT} <= {state for state, one in TRANSITIONS if one is event}
    assert {state for state, event in TRANSITIONS if event is ConnectionEvent.NEW_CONNECTION} == set(ConnectionState)


def test_probe_is_an_answered_read_with_a_unique_reply():
    protocol = ready()
    outcome_of(protocol, ANOTHER_FUNCTION, rtu.seal(1, bytes.fromhex("04 06 0001 0002 0003")))
    unanswered(protocol, READ)
    assert protocol.needs_probe(1, SAME_KIND, 1.0)
    assert protocol.probes.probe_request(1, SAME_KIND, 0, 1.0) == ANOTHER_FUNCTION
    unanswered(protocol, ANOTHER_FUNCTION)
    assert protocol.probes.probe_request(1, SAME_KIND, 0, 1.0) == requests.read_input(10, 1)
    assert not protocol.needs_probe(1, requests.write_register(1, 2), 1.0)


def test_an_unknown_device_is_probed_with_another_length_then_with_another_function():
    protocol = ready()
    unanswered(protocol, READ)
    assert protocol.probes.probe_request(1, READ, 0, 1.0) == requests.read_holding(10, 1)
    assert protocol.probes.probe_request(1, READ, 1, 1.0) == requests.read_input(10, 1)


def answer(protocol, request):
    """Let the device answer the request with zeros."""
    size = request.payload_size
    outcome_of(protocol, request, rtu.seal(1, bytes((request.function, size)) + bytes(size)))


def test_a_sync_is_a_known_read_whose_kind_has_not_arrived_lately():
    protocol = ready()
    for count in (12, 11, 12):
        answer(protocol, requests.read_holding(0, count))
    kinds = set()
    for _ in range(11):
        sync = protocol.probes.sync_request(1, requests.read_holding(50, 12), 1.0)
        assert sync.payload_size < 24
        kinds.add(sync.payload_size)
        answer(protocol, sync)
        answer(protocol, requests.read_holding(50, 12))
    assert len(kinds) >= 8


def test_where_a_device_refuses_other_lengths_a_sync_uses_other_functions():
    """All exceptions of one function look alike, so a function whose exception arrived lately proves nothing."""
    protocol = ready()
    answer(protocol, READ)
    functions = []
    for _ in range(8):
        sync = protocol.probes.sync_request(1, READ, 1.0)
        functions.append(sync.function)
        outcome_of(protocol, sync, rtu.seal(1, bytes((sync.function | 0x80, 2))))
        answer(protocol, READ)
    assert set(functions) == {1, 2, 3, 4}
    assert all(len(set(functions[at : at + 4])) == 4 for at in range(5))


def test_a_sync_that_met_silence_is_not_sent_again():
    protocol = ready()
    first = protocol.probes.sync_request(1, READ, 1.0)
    unanswered(protocol, first)
    assert protocol.probes.stays_silent(1, first)
    assert protocol.probes.sync_request(1, READ, LATEST_REPLY_S + 1.0) != first
