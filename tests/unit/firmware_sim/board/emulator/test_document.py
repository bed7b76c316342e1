"""The program of the microcontroller answers as docs/sma-reference.md says, byte for byte."""

import re

import pytest
from emulated_board import STATE, UNIT_ID, EmulatedBoard, needs_emulator

from smadrive.files.shipped import configs_dir
from smadrive.modbus.framing import rtu

pytestmark = needs_emulator
DOCUMENT = (configs_dir().parent / "docs" / "sma-reference.md").read_text(encoding="utf-8")
DIALOGUE = re.findall(r"^\| ((?:[0-9A-F]{2} )+[0-9A-F]{2}) \| ((?:[0-9A-F]{2} ?)+) \|", DOCUMENT, re.MULTILINE)


def test_board_answers_like_the_documented_dialogue():
    assert len(DIALOGUE) == 18
    board = EmulatedBoard()
    replies = [board.send(bytes.fromhex(request)) for request, _ in DIALOGUE]
    assert [[frame.hex(" ").upper() for frame in answer] for answer in replies] == [[reply] for _, reply in DIALOGUE]


@pytest.mark.parametrize("unit_id", [0, 2, 247])
def test_no_reply_to_other_units_and_broadcasts(unit_id):
    board = EmulatedBoard()
    assert board.send(rtu.seal(unit_id, bytes.fromhex("03 00 00 00 02"))) == []
    assert board.read(STATE) == [0]


def test_frame_ends_at_the_pause():
    board = EmulatedBoard()
    frame = rtu.seal(UNIT_ID, bytes.fromhex("03 00 00 00 02"))
    assert board.send(frame[:5]) == []  # the exchange waits 10 ms
    assert board.send(frame[5:]) == []
    assert board.read(0, 2) == [0x534D, 2]


def test_pause_counts_although_the_interrupt_delays_the_main_loop():
    """The first byte of a frame, a pause, and the other bytes are no frame, at any phase of the safety interrupt."""
    board = EmulatedBoard()
    frame = rtu.seal(UNIT_ID, bytes.fromhex("03 00 00 00 02"))
    for _ in range(50):
        board.chip.send(frame[:1])
        board.run(0.0021)
        board.chip.send(frame[1:])
        board.run(0.0081)
        assert board.chip.receive() == []
    assert board.read(0, 2) == [0x534D, 2]
