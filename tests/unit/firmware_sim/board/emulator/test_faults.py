"""Faults of chips, buses, main loop and supply: a named fault, and the current is zero in time."""

import pytest
from emulated_board import (
    ARM,
    CLEAR,
    CURRENT,
    FAULT,
    IDLE,
    STATE,
    TEMPERATURE,
    EmulatedBoard,
    needs_emulator,
    reset_while_heating,
)

from firmware_sim.board.emulator.microcontroller import HZ, Converter, Reset, Stuck
from firmware_sim.devices.board.readings import BoardFault

pytestmark = needs_emulator
TICK_S, WATCHDOG_S, LATE_S = 0.01, 0.5, 0.02
CONVERSION_S = 0.09
BUS = BoardFault.SENSOR_BUS | BoardFault.ACTUATOR

FAULTS = {
    "converter open": ("converter", Converter.OPEN, BoardFault.THERMOCOUPLE_OPEN, CONVERSION_S + TICK_S),
    "converter short": ("converter", Converter.SHORT, BoardFault.THERMOCOUPLE_SHORT, 2 * TICK_S),
    "converter absent": ("converter", Converter.ABSENT, BoardFault.SENSOR_BUS, 4 * TICK_S),
    "converter stopped": ("converter", Converter.STOPPED, BoardFault.SENSOR_BUS, 0.4),
    "converter resetting": ("converter", Converter.RESETTING, BoardFault.SENSOR_BUS, 0.4),
    "SDA stuck": ("stuck", Stuck.SDA, BUS, 2 * TICK_S),
    "SCL stuck": ("stuck", Stuck.SCL, BUS, 2 * TICK_S),
    "DAC absent": ("dac_absent", 1, BoardFault.ACTUATOR, 2 * TICK_S),
    "upper meter absent": ("top_meter_absent", 1, BoardFault.SENSOR_BUS, 4 * TICK_S),
    "lower meter absent": ("bottom_meter_absent", 1, BoardFault.SENSOR_BUS, 4 * TICK_S),
    "emergency stop": ("estop_open", 1, BoardFault.ESTOP, 2 * TICK_S),
}
GOOD = {"converter": Converter.GOOD, "stuck": Stuck.NONE}


@pytest.fixture
def board():
    return EmulatedBoard()


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_named_and_switches_off(board, name):
    field, value, fault, limit_s = FAULTS[name]
    board.heat()
    setattr(board.world, field, value)
    board.wait_for_off(limit_s)
    board.run(0.1)
    assert board.registers() == (FAULT, fault)
    setattr(board.world, field, GOOD.get(field, 0))
    board.run(0.3)
    assert board.chip.sink_a == 0.0
    assert board.press(CLEAR) == 0
    assert board.registers() == (IDLE, 0)
    board.heat()


LOST_READINGS = {
    "converter absent": (TEMPERATURE, 2, [0x8000, 0x8000]),
    "converter stopped": (TEMPERATURE, 2, [0x8000, 0x8000]),
    "upper meter absent": (CURRENT, 2, [0xFFFF, 0xFFFF]),
    "lower meter absent": (CURRENT, 2, [0xFFFF, 0xFFFF]),
}


@pytest.mark.parametrize("name", LOST_READINGS)
def test_silent_chip_has_no_reading_until_it_answers_again(board, name):
    field, value, _, limit_s = FAULTS[name]
    first, count, lost = LOST_READINGS[name]
    setattr(board.world, field, value)
    board.run(limit_s + TICK_S)
    assert board.read(first, count) == lost
    setattr(board.world, field, GOOD.get(field, 0))
    board.run(0.3)
    assert not set(board.read(first, count)) & set(lost)


def test_stuck_bus_does_not_delay_the_interrupt(board):
    board.heat()
    board.chip.probes.safety_longest = 0
    board.world.stuck = Stuck.SCL
    board.run(0.2)
    assert 0 < board.chip.probes.safety_longest <= 2e-3 * HZ


def test_silent_host_trips_the_watchdog(board):
    board.heat()
    board.command(0.3)
    fed = int(board.chip.probes.received_at)
    board.run(WATCHDOG_S + 2 * LATE_S)
    assert board.chip.sink_a == 0.0
    assert WATCHDOG_S - TICK_S < (int(board.chip.probes.disabled_at) - fed) / HZ <= WATCHDOG_S + LATE_S
    assert board.registers() == (FAULT, BoardFault.WATCHDOG)


def test_hung_main_loop_switches_off_and_resets():
    board = EmulatedBoard(hang_hook=True)
    board.heat()
    board.chip.hang()
    board.run(0.01)
    hung = board.chip.cycle
    board.wait_for_off(0.3)
    assert (int(board.chip.probes.disabled_at) - hung) / HZ <= 0.3
    board.run(0.5)
    assert board.chip.probes.resets_by_watchdog == 1
    assert board.registers() == (IDLE, 0)  # the reset has ended the hang


@pytest.mark.parametrize("cause", Reset)
def test_reset_switches_off_at_once(cause):
    board = reset_while_heating(cause, seed=5)
    assert board.chip.sink_a == 0.0
    board.run(0.3)
    assert board.chip.sink_a == 0.0
    assert board.command(0.3)[1] == IDLE  # a host that goes on heating sees the state
    board.run(0.05)
    assert board.chip.sink_a == 0.0
    board.heat()


@pytest.mark.exhaustive
@pytest.mark.parametrize("cause", Reset)
def test_reset_at_any_instruction_switches_off_at_once(cause):
    for seed in range(200):
        board = reset_while_heating(cause, seed)
        assert board.chip.sink_a == 0.0
        sequence = board.sequence
        for _ in range(30):
            board.run(0.01)
            assert board.chip.sink_a == 0.0
        assert board.read(STATE) == [IDLE]
        assert board.read(16) != [sequence]


def test_power_cycle_restores_a_dac_that_leaves_the_factory_at_half_of_its_scale(board):
    """The DAC outputs half of its scale at power-up. The enable line keeps the sink off, and the program sets 0."""
    board.chip.reset(Reset.POWER)
    for _ in range(100):
        board.chip.step(2000)
        assert board.chip.sink_a == 0.0
    board.run(0.3)
    assert board.chip.probes.enabled_at == 0  # the line was never high
    assert board.press(ARM) == 0
    board.run(0.05)
    assert board.chip.sink_a == 0.0


@pytest.mark.parametrize("held", [Stuck.SDA, Stuck.SCL])
def test_bus_that_is_stuck_at_power_up_is_a_fault(held):
    board = EmulatedBoard()
    board.world.stuck = held
    board.chip.reset(Reset.POWER)
    board.run(0.6)
    state, faults = board.registers()
    assert state == FAULT
    assert faults & BUS == BUS
