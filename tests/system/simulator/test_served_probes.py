"""Conformance on a serial line, byte by byte: requests that other servers answer wrongly."""

import pytest
from served import served

from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.connect import open_transport

READ = bytes.fromhex("03 0000 0002")
REPLY = rtu.seal(1, bytes.fromhex("03 04 534D 0002"))


@pytest.fixture(scope="module")
def board():
    with served() as (_, url):
        yield url


@pytest.fixture
def line(board):
    with open_transport(board) as transport:
        yield transport


def answer(line, within_s=60.0, pause_s=0.2):
    """Return all bytes that arrive until the line has been silent for `pause_s`."""
    data = line.read(line.clock.now_s() + within_s)
    while more := line.read(line.clock.now_s() + pause_s):
        data += more
    return data


@pytest.mark.parametrize(
    ("pdu", "reply"),
    [
        ("03 0000 0000", "83 03"),
        ("03 0000 007E", "83 03"),
        ("04 0000 0001", "84 01"),
        ("63 0000", "E3 01"),
        ("03 0064 0001", "83 02"),
        ("03 FFFF 0002", "83 02"),
        ("05 0000 1234", "85 01"),
        ("10 0030 0002 03 0007 00", "90 03"),
        ("10 0030 0002 02 0007", "90 03"),
        ("17 0000 0000 0000 0001 02 0000", "97 03"),
        ("17 0000 0001 0000 0000 00", "97 03"),
        ("17 0005 0001 0030 0001 02 02BC", "97 02"),
        ("06 0000 0001", "86 02"),
        ("06 0030 0001", "86 03"),
        ("08 0000 1234", "08 0000 1234"),
        ("08 0001 0000", "88 01"),
        ("03 0030 0001", "03 02 01F4"),  # unchanged by the requests above
    ],
)
def test_request_gets_the_reply_of_the_standard(line, pdu, reply):
    line.write(rtu.seal(1, bytes.fromhex(pdu)))
    assert answer(line) == rtu.seal(1, bytes.fromhex(reply))


OWN_FORM = {
    **dict.fromkeys((7, 11, 12, 17), ""),
    15: "0000 0001 01 00",
    20: "07 06 0001 0000 0001",
    21: "09 06 0001 0000 0001 0000",
    24: "0000",
    43: "0E 01 00",
}


@pytest.mark.parametrize("code", [code for code in range(1, 128) if code not in (3, 6, 8, 16, 22, 23)])
def test_every_other_function_gets_illegal_function(line, code):
    line.write(rtu.seal(1, bytes((code,)) + bytes.fromhex(OWN_FORM.get(code, "0000 0001"))))
    assert answer(line, pause_s=0.01) == rtu.seal(1, bytes((code | 0x80, 1)))


@pytest.mark.parametrize(
    "bytes_",
    [
        rtu.seal(2, READ),
        rtu.seal(1, READ)[:-1] + b"\0",
        rtu.seal(1, READ)[:-3],
        rtu.seal(0, bytes.fromhex("06 0030 02BC")),
        bytes(300),
    ],
    ids=["another unit", "wrong crc", "half a frame", "broadcast", "oversize"],
)
def test_ignored_bytes_do_not_disturb_the_next_request(line, bytes_):
    line.write(bytes_)
    assert answer(line, within_s=0.3) == b""
    line.write(rtu.seal(1, READ))
    assert answer(line) == REPLY


def test_requests_behind_junk_two_at_once_and_byte_by_byte_are_answered(line):
    line.write(b"\x55\x00\xff" + rtu.seal(1, READ))
    assert answer(line) == REPLY
    line.write(2 * rtu.seal(1, READ))
    assert answer(line) == 2 * REPLY
    for byte in rtu.seal(1, READ):
        line.write(bytes((byte,)))
    assert answer(line) == REPLY
