"""The program reads and sets the chips on the buses: units, signs, identity, storage."""

import struct

import pytest
from emulated_board import (
    CLEAR,
    CURRENT,
    DISPLACEMENT,
    FAULT,
    IDLE,
    SAMPLES,
    TEMPERATURE,
    WIRE_OHM,
    EmulatedBoard,
    needs_emulator,
)

from firmware_sim.board.emulator.microcontroller import Reset
from firmware_sim.devices.board.readings import BoardFault

pytestmark = needs_emulator
GAIN, SAVE, SAVE_KEY = 64, 70, 0x4341


@pytest.fixture
def board():
    return EmulatedBoard()


def signed(word):
    return struct.unpack(">h", struct.pack(">H", word))[0]


@pytest.mark.parametrize(
    ("bead_c", "cold_c"), [(25.5, 20.25), (-10.25, -5.5), (0.0, 0.0), (156.7, 84.0), (326.0, 60.0)]
)
def test_temperatures_are_converted(board, bead_c, cold_c):
    board.world.temperature_c, board.world.cold_junction_c = bead_c, cold_c
    board.run(0.2)
    hot, cold = (signed(word) / 100 for word in board.read(TEMPERATURE, 2))
    assert hot == pytest.approx(bead_c, abs=0.0078 / 2 + 0.01)
    assert cold == pytest.approx(cold_c, abs=0.0156 / 2 + 0.01)


def test_conversions_are_counted(board):
    before = board.read(SAMPLES)[0]
    board.run(0.82)
    assert board.read(SAMPLES)[0] - before in (9, 10, 11)  # of 82 ms


@pytest.mark.parametrize("current_a", [0.01, 0.1, 0.5, 1.0])
def test_current_is_set_and_measured(board, current_a):
    board.heat(current_a)
    current, voltage = board.read(CURRENT, 2)
    assert current / 1e4 == pytest.approx(current_a, abs=4e-4)  # 12 bits of 1.024 A, and 50 uA of the meter
    assert voltage / 1e3 == pytest.approx(WIRE_OHM * board.chip.sink_a, abs=3e-3)


def test_no_displacement_without_the_jumper(board):
    assert board.read(DISPLACEMENT, 2) == [0x8000, 0]


def test_displacement_is_measured(board):
    board.world.displacement_fitted, board.world.displacement_v = 1, 0.55
    board.run(0.05)
    high, low = board.read(DISPLACEMENT, 2)
    assert (high << 16 | low) / 1e4 == pytest.approx(11.264, abs=0.05)


def test_serial_number_comes_from_the_storage(board):
    assert board.read(3, 2) == [123_456 >> 16, 123_456 & 0xFFFF]


def test_empty_storage_is_a_fault_until_the_calibration_is_saved():
    board = EmulatedBoard(eeprom=b"\xff" * 32)
    assert board.registers() == (FAULT, BoardFault.SELF_TEST)
    assert board.read(3, 2) == [0, 0]
    board.press(CLEAR)
    assert board.registers() == (FAULT, BoardFault.SELF_TEST)
    assert board.write(SAVE, SAVE_KEY) == 0
    board.run(0.1)
    board.press(CLEAR)
    assert board.registers() == (IDLE, 0)
    board.heat()


def test_saved_calibration_survives_a_power_cycle(board):
    assert board.write(GAIN, 16500) == 0
    assert board.write(SAVE, SAVE_KEY) == 0
    board.run(0.1)
    board.chip.reset(Reset.POWER)
    board.run(0.3)
    assert board.read(GAIN) == [16500]
    assert board.registers() == (IDLE, 0)


def test_interrupted_saving_is_a_fault(board):
    board.write(GAIN, 16500)
    board.write(SAVE, SAVE_KEY)
    board.chip.reset(Reset.LINE)  # the record needs 14 bytes of 3.4 ms
    board.run(0.3)
    assert board.registers() == (FAULT, BoardFault.SELF_TEST)


def test_sequence_starts_at_random(board):
    starts = {EmulatedBoard(seed=seed).read(16)[0] for seed in range(4)}
    assert len(starts) == 4
    assert min(starts) >= 256


def test_clear_key_has_no_effect_while_the_cause_persists(board):
    board.world.estop_open = 1
    board.run(0.03)
    assert board.press(CLEAR) == 0
    assert board.registers() == (FAULT, BoardFault.ESTOP)
    board.world.estop_open = 0
    board.run(0.03)
    assert board.press(CLEAR) == 0
    assert board.registers() == (IDLE, 0)
