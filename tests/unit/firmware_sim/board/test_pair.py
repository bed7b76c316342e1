"""Two implementations, one specification: the board in Python and the core in C give the same at every step."""

import struct

import pytest
from board_fuzz import BoardFuzzer
from board_machine import BoardMachine
from board_pair import PROFILE, BoardPair, DifferenceError, Frames
from hypothesis import settings
from marks import exhaustive

from firmware_sim.devices.board.calibration import BoardCalibration
from firmware_sim.devices.board.readings import BoardFault
from smadrive.modbus.framing import rtu

READ_ID = rtu.seal(1, bytes.fromhex("03 00 00 00 01"))

TestBoards = BoardMachine.TestCase
TestBoards.settings = settings(max_examples=8, stateful_step_count=30, deadline=None)


@pytest.mark.parametrize(("seed", "steps"), [(1, 2_000), exhaustive(2, 100_000)])
def test_random_steps_make_no_difference(seed, steps):
    fuzzer = BoardFuzzer(BoardPair(seed=seed), seed)
    for _ in range(steps):
        fuzzer.step()
    assert fuzzer.missing() == []


def test_pair_detects_a_difference():
    pair = BoardPair()
    pair.python.write({"watchdog_s": 0.3})
    with pytest.raises(DifferenceError):
        pair.compare()


@pytest.mark.exhaustive
class TestManyBoards(BoardMachine.TestCase):
    settings = settings(max_examples=300, stateful_step_count=60, deadline=None)


@pytest.mark.parametrize(
    ("data", "answers"),
    [
        (READ_ID, 1),
        (READ_ID + READ_ID, 2),
        (b"\x00" + READ_ID, 0),
        (READ_ID[:-1] + b"\x00" + READ_ID, 0),
        (READ_ID + b"\x01", 1),
        (rtu.seal(2, READ_ID[1:-2]) + READ_ID, 1),
        (rtu.seal(0, READ_ID[1:-2]) + READ_ID, 1),
        (rtu.seal(1, bytes.fromhex("41 00 00")), 1),
        (rtu.seal(1, bytes.fromhex("41 00 00")) + READ_ID, 0),
        (rtu.seal(1, b"\x41" + bytes(252)), 1),
        (rtu.seal(1, b"\x41" + bytes(253)), 0),
        (rtu.seal(1, bytes.fromhex("10 00 20 00 7B F6") + bytes(246)), 1),
        (b"\x01", 0),
        (b"", 0),
    ],
)
def test_frames_are_found_by_length_and_pause(data, answers):
    pair = BoardPair()
    replies = pair.send(data) + pair.pause()
    assert len(replies) == answers * (7 if data.startswith(READ_ID) or READ_ID in data else 5)
    assert pair.send(READ_ID)[:5].hex() == "010302534d"


def test_last_byte_of_a_request_alone_gets_the_whole_reply():
    pair = BoardPair()
    request = rtu.seal(1, bytes.fromhex("03 00 10 00 0E"))
    assert pair.send(request[:-1]) == b""
    assert len(pair.send(request[-1:])) == 33


def test_no_part_of_a_spoiled_frame_is_carried_out():
    pair = BoardPair()
    arm = rtu.seal(1, bytes.fromhex("06 00 28 41 52"))
    outer = bytearray(rtu.seal(1, bytes.fromhex("10 00 20 00 04 08") + arm))
    outer[-1] ^= 1
    assert pair.send(bytes(outer)) + pair.pause() == b""
    assert pair.python.state == 0


def test_frame_search_of_the_pair_forgets_a_bad_frame_at_the_pause():
    frames = Frames()
    assert [frames.take(byte) for byte in READ_ID[:-1] + b"\x00"] == [None] * 8
    assert frames.pause() is None
    assert [frames.take(byte) for byte in READ_ID][-1] == READ_ID


def spoiled_records():
    """Records with one constant just outside its limits, and records whose checksum is wrong."""
    right = BoardCalibration()
    for part in ("current", "voltage", "source"):
        for constant, value in (("gain", 12287), ("gain", 20481), ("offset", -501), ("offset", 501)):
            yield right.changed(f"{part}_{constant}", value).record()
    yield from (right.record()[:-1] + b"\x00", bytes(14), b"\xff" * 14)


@pytest.mark.parametrize("record", [*spoiled_records()], ids=bytes.hex)
def test_record_that_is_not_valid_is_detected_by_both(record):
    pair = BoardPair()
    pair.restart(record)
    assert pair.python.faults == BoardFault.SELF_TEST
    assert pair.ask(bytes.fromhex("03 00 40 00 01")).hex() == "03024000"


@pytest.mark.parametrize("register", [*PROFILE.registers.values()], ids=[*PROFILE.registers])
def test_limits_of_every_register_are_the_same(register):
    pair = BoardPair()
    words = {0, 1, 0x7FFF, 0x8000, 0xFFFF, *register.enum}
    for limit in (register.min, register.max) if register.writable and not register.enum else ():
        count = round(limit / register.scale)
        words |= {count - 1 & 0xFFFF, count & 0xFFFF, count + 1 & 0xFFFF}
    for word in sorted(words):
        pair.ask(struct.pack(">BHH", 6, register.address, word))
        pair.ask(struct.pack(">BHH", 3, register.address, register.size))
