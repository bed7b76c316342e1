"""Frames and requests, compared with golden frames of the standard and with pymodbus."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import bit_message, register_message

from smadrive.modbus import requests
from smadrive.modbus.framing import rtu

words = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=121)
address = st.integers(0, 0xFF00)

# Application protocol V1.1b3, the examples of section 6; reply payload in the third column.
GOLDEN = [
    (requests.read_coils(0x13, 0x13), "01 00 13 00 13", "01 03", 3),
    (requests.read_discrete(0xC4, 0x16), "02 00 C4 00 16", "02 03", 3),
    (requests.read_holding(0x6B, 3), "03 00 6B 00 03", "03 06", 6),
    (requests.read_input(8, 1), "04 00 08 00 01", "04 02", 2),
    (requests.write_coil(0xAC, True), "05 00 AC FF 00", "05 00 AC FF 00", 0),
    (requests.write_register(1, 3), "06 00 01 00 03", "06 00 01 00 03", 0),
    (
        requests.write_coils(0x13, [True, False, True, True, False, False, True, True, True, False]),
        "0F 00 13 00 0A 02 CD 01",
        "0F 00 13 00 0A",
        0,
    ),
    (requests.write_registers(1, [0x0A, 0x0102]), "10 00 01 00 02 04 00 0A 01 02", "10 00 01 00 02", 0),
    (
        requests.exchange(0x0E, [0xFF, 0xFF, 0xFF], 3, 6),
        "17 00 03 00 06 00 0E 00 03 06 00 FF 00 FF 00 FF",
        "17 0C",
        12,
    ),
]


@pytest.mark.parametrize(("request_", "pdu", "head", "payload_size"), GOLDEN, ids=lambda value: str(value)[:12])
def test_requests_are_those_of_the_standard(request_, pdu, head, payload_size):
    assert request_.pdu == bytes.fromhex(pdu)
    assert request_.reply_head == bytes.fromhex(head)
    assert request_.payload_size == payload_size


@pytest.mark.parametrize(
    "golden",
    [
        "01 03 00 04 00 26 85 D1",
        "01 03 00 50 00 04 44 18",
        "01 06 00 12 00 01 E8 0F",
        "01 10 00 52 00 03 06 03 E8 05 DC 04 E2 67 90",
        "01 05 08 10 FF 00 8F 9F",
    ],
)
def test_requests_match_frames_captured_from_real_devices(golden):
    frame = bytes.fromhex(golden)
    assert rtu.seal(frame[0], frame[1:-2]) == frame
    assert rtu.crc_holds(frame)
    assert rtu.request_size(frame) == len(frame)


@given(st.binary(min_size=2, max_size=253), st.integers(0, 255))
def test_crc_agrees_with_pymodbus(body, flipped):
    frame = body + rtu.crc(body)
    assert int.from_bytes(frame[-2:], "big") == FramerRTU.compute_CRC(body)
    damaged = bytearray(frame)
    damaged[flipped % len(frame)] ^= 1 << flipped % 8
    assert not rtu.crc_holds(bytes(damaged))


@given(address, words, address, st.integers(1, 125))
def test_register_requests_agree_with_pymodbus(write_address, values, read_address, count):
    read = register_message.ReadHoldingRegistersRequest(address=read_address, count=count)
    both = register_message.ReadWriteMultipleRegistersRequest(read_address, count, write_address, values)
    several = register_message.WriteMultipleRegistersRequest(address=write_address, registers=values)
    one = register_message.WriteSingleRegisterRequest(address=write_address, registers=values[:1])
    assert requests.read_holding(read_address, count).pdu == b"\x03" + read.encode()
    assert requests.exchange(write_address, values, read_address, count).pdu == b"\x17" + both.encode()
    assert requests.write_registers(write_address, values).pdu == b"\x10" + several.encode()
    assert requests.write_register(write_address, values[0]).pdu == b"\x06" + one.encode()


@given(address, st.lists(st.booleans(), min_size=1, max_size=1968))
def test_bit_requests_agree_with_pymodbus(first, states):
    several = bit_message.WriteMultipleCoilsRequest(address=first, bits=states)
    assert requests.write_coils(first, states).pdu == b"\x0f" + several.encode()
    assert requests.bits_of(requests.write_coils(first, states).pdu[6:], len(states)) == tuple(states)


@pytest.mark.parametrize(
    "make",
    [
        lambda: requests.read_holding(0, 0),
        lambda: requests.read_holding(0, 126),
        lambda: requests.read_holding(65535, 2),
        lambda: requests.read_coils(0, 2001),
        lambda: requests.write_registers(0, [0] * 124),
        lambda: requests.exchange(0, [0] * 122, 0, 1),
        lambda: requests.exchange(0, [0], 0, 126),
        lambda: requests.write_register(-1, 0),
    ],
)
def test_request_outside_the_standard_is_refused(make):
    with pytest.raises(ValueError, match="addresses"):
        make()


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (lambda: requests.write_coil(0, "off"), "'off'"),
        (lambda: requests.write_coils(0, [True, 2]), "2"),
        (lambda: requests.write_register(0, 0x10000), "65536"),
        (lambda: requests.write_registers(0, [1, -1]), "-1"),
        (lambda: requests.exchange(0, [0.5], 0, 1), "0.5"),
    ],
)
def test_value_that_a_coil_or_a_register_cannot_hold_is_refused(make, value):
    with pytest.raises(ValueError, match=f"^{re.escape(value)} is not"):
        make()


def test_unfinished_and_unknown_requests_have_no_size():
    whole = rtu.seal(1, requests.write_registers(0, [1, 2]).pdu)
    assert rtu.request_size(b"\x01") is None
    assert rtu.request_size(whole[:6]) is None
    assert rtu.request_size(whole[:7]) == len(whole)
    assert rtu.request_size(b"\x01\x63\x00\x00") == rtu.UNKNOWN_SIZE
    assert rtu.request_size(b"\x01\x83\x02\x00") == rtu.UNKNOWN_SIZE
