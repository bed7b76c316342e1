"""Conformance with the Modbus standard, frame by frame."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_sim.bus.stream import RequestStream
from smadrive.modbus.framing import rtu

CURRENT = "00 21"  # heater_current
READ_ID = "03 00 00 00 01"


@pytest.mark.parametrize(
    ("pdu", "answer"),
    [
        ("03 00 00 00 02", "03 04 53 4D 00 02"),
        ("03 00 00 00 00", "83 03"),
        ("03 00 00 00 7E", "83 03"),
        ("03 FF FF 00 02", "83 02"),
        ("03 00 04 00 02", "83 02"),
        ("04 00 00 00 01", "84 01"),
        ("01 00 00 00 01", "81 01"),
        ("05 00 00 12 34", "85 01"),
        ("63 00 00", "E3 01"),
        ("06 00 20 01 07", "06 00 20 01 07"),
        ("06 00 20 00 FF", "86 03"),
        ("06 00 21 C3 51", "86 03"),
        ("06 00 22 00 02", "86 03"),
        ("06 00 10 00 01", "86 02"),
        ("06 00 06 00 01", "86 02"),
        ("06 00 30 00 00", "86 03"),
        ("06 00 31 06 41", "86 03"),
        ("06 00 28 00 01", "86 03"),
        ("10 00 20 00 02 04 01 07 00 00", "10 00 20 00 02"),
        ("10 00 20 00 02 03 00 07 00", "90 03"),
        ("10 00 20 00 01 04 00 07 00 00", "90 03"),
        ("10 00 20 00 00 00", "90 03"),
        ("10 00 22 00 02 04 00 00 00 00", "90 02"),
        ("16 00 20 00 F0 01 05", "16 00 20 00 F0 01 05"),
        ("16 00 10 00 F0 00 05", "96 02"),
        ("17 00 10 00 00 00 20 00 01 02 00 07", "97 03"),
        ("17 00 10 00 01 00 20 00 00 00", "97 03"),
        ("17 00 10 00 01 00 20 00 01 04 00 07 00 00", "97 03"),
        ("17 00 10 00 02 00 20 00 01 02 01 07", "17 04 01 07 00 00"),
        ("08 00 00 A5 37", "08 00 00 A5 37"),
        ("08 00 01 A5 37", "88 01"),
    ],
)
def test_request_gets_the_reply_of_the_standard(ask, pdu, answer):
    assert ask(pdu) == answer


def test_unknown_function_gets_an_exception(ask):
    for function in set(range(1, 128)) - {3, 4, 6, 8, 16, 22, 23}:
        answer = ask(f"{function:02X} 00 00 00 01 00 00 00 00 00 00")
        assert answer in (f"{function | 0x80:02X} 01", None), function
    assert ask(READ_ID) is not None


def test_exchange_with_illegal_read_range_writes_nothing(ask):
    before = ask("03 00 20 00 01")
    assert ask("17 01 00 00 01 00 20 00 01 02 01 63") == "97 02"
    assert ask("03 00 20 00 01") == before != "03 02 01 63"


def test_block_write_with_one_bad_value_writes_nothing(ask):
    before = ask("03 00 20 00 01")
    assert ask("10 00 20 00 03 06 01 63 FF FF 00 00") == "90 03"
    assert ask("03 00 20 00 01") == before != "03 02 01 63"


def test_other_unit_and_wrong_crc_get_no_reply(simulated, ask):
    assert ask(READ_ID, unit=2) is None
    frame = rtu.seal(1, bytes.fromhex(READ_ID))
    assert simulated.line.receive(frame[:-1] + b"\x00", simulated.bench.time_s) == []
    simulated.bench.advance_to(1.0)
    assert ask(READ_ID) == "03 02 53 4D"


def test_broadcast_is_carried_out_without_reply(ask):
    assert ask("06 00 20 01 63", unit=0) is None
    assert ask("03 00 20 00 01") == "03 02 01 63"


def test_request_byte_by_byte_is_answered(simulated):
    replies = []
    for byte in rtu.seal(1, bytes.fromhex(READ_ID)):
        replies += simulated.line.receive(bytes((byte,)), simulated.bench.time_s + 0.001)
    assert len(replies) == 1


def test_two_requests_at_once_get_two_replies(simulated):
    one, two = (rtu.seal(1, bytes.fromhex(pdu)) for pdu in (READ_ID, "03 00 01 00 01"))
    assert [frame[3:5] for _, frame in simulated.line.receive(one + two, 0.0)] == [b"\x53\x4d", b"\x00\x02"]


@pytest.mark.parametrize("junk", ["FF", "00 00 00", "DE AD BE EF", "7F 7F", "01 63"])
def test_request_behind_junk_is_answered(simulated, junk):
    request = rtu.seal(1, bytes.fromhex(READ_ID))
    assert len(simulated.line.receive(bytes.fromhex(junk) + request, 0.0)) == 1
    assert simulated.line.port.stream.bad_bytes == len(bytes.fromhex(junk))


def test_truncated_request_is_dropped_after_a_pause(simulated):
    request = rtu.seal(1, bytes.fromhex(READ_ID))
    assert simulated.line.receive(request[:5], 0.0) == []
    assert len(simulated.line.receive(request, 1.0)) == 1


@given(st.lists(st.binary(max_size=40), max_size=20))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_request_after_noise_and_a_pause_is_found(noise):
    stream = RequestStream()
    for number, junk in enumerate(noise):
        stream.feed(junk, 0.001 * number)
    request = rtu.seal(1, bytes.fromhex(READ_ID))
    assert stream.feed(request, 10.0) == [request]


def test_reply_of_another_device_is_ignored(simulated):
    foreign = rtu.seal(2, bytes.fromhex("03 04 00 01 00 02"))
    simulated.line.receive(foreign, 0.0)
    assert len(simulated.line.receive(rtu.seal(1, bytes.fromhex(READ_ID)), 1.0)) == 1
