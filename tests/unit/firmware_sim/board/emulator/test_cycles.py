"""Figures of the program in cycles of the emulated microcontroller, and its size."""

import re
import subprocess

import pytest
from emulated_board import EmulatedBoard, needs_emulator

from firmware_sim.board.emulator.build import TARGET, firmware_file, ranges
from firmware_sim.board.emulator.microcontroller import HZ, RAM_SIZE, Reset
from firmware_sim.config import Board, load_sim
from smadrive.modbus.framing import rtu

pytestmark = needs_emulator
FLASH_LIMIT, RAM_LIMIT = 24 * 1024, 1536
UNTOUCHED = 0xC5
US = HZ // 1_000_000
TICK = rtu.seal(1, bytes.fromhex("17 00 10 00 0B 00 20 00 03 06 12 34 0B B8 00 01"))


@pytest.fixture(scope="module")
def heated():
    """A board after 2 s of heating, with the ticks of a host."""
    board = EmulatedBoard()
    board.heat()
    board.heat_for(2.0)
    return board


def test_safety_interrupt_is_short(heated):
    assert heated.chip.probes.safety_count > 200
    assert 100 * US < heated.chip.probes.safety_longest <= 2000 * US


def test_safety_interrupt_is_punctual(heated):
    assert heated.chip.probes.safety_latency_max <= 150 * US


def test_interrupts_are_off_for_a_short_time_only(heated):
    assert 0 < heated.chip.probes.off_longest <= 150 * US


def test_no_byte_is_lost_at_full_speed(heated):
    """256 requests without a pause: every byte arrives while the program answers and the interrupt runs."""
    heated.chip.send(256 * rtu.seal(2, bytes.fromhex("03 00 10 00 0B")))
    heated.run(0.3)
    assert heated.chip.probes.overruns == 0


def test_reply_to_a_tick_begins_soon(heated):
    for phase in range(20):  # at different times of the interrupt
        heated.chip.receive()
        heated.chip.run(0.0005 * phase + 0.003)
        heated.chip.send(TICK)
        heated.chip.run(0.015)
        first = heated.chip.receive()[0]
        assert 0 < first.cycle - heated.chip.probes.received_at <= 5000 * US


def variables(elf):
    report = subprocess.run(["avr-size", "-A", elf], capture_output=True, text=True, check=True).stdout
    sizes = {name: int(size) for name, size in re.findall(r"^\.(\w+)\s+(\d+)", report, re.MULTILINE)}
    return sizes["text"] + sizes["data"], sum(sizes.get(name, 0) for name in ("data", "bss", "noinit"))


def test_flash_and_ram_are_within_their_limits():
    board = EmulatedBoard()
    elf = firmware_file(load_sim("flexinol-lt-0.15mm").board)
    flash, ram = variables(elf)
    board.chip.fill_ram(UNTOUCHED)
    board.chip.reset(Reset.LINE)
    board.run(0.3)
    board.heat()
    board.heat_for(1.0)
    board.send(TICK[:3] + TICK)
    content = board.chip.read_ram()
    stack = RAM_SIZE - next(at for at in range(ram, RAM_SIZE) if content[at] != UNTOUCHED)
    assert 0 < flash <= FLASH_LIMIT
    assert 64 < stack < 512
    assert ram + stack <= RAM_LIMIT


@pytest.mark.parametrize("fitted", ranges(), ids=lambda one: one.name)
def test_every_range_is_built(fitted):
    board = Board(watchdog_s=0.5, temperature_max_c=160.0, supply_limit_a=fitted.supply_limit_a)
    assert firmware_file(board).exists()
    assert fitted.supply_limit_a < fitted.full_scale_a
    assert 1.1 * fitted.supply_limit_a + 0.05 < 0.0819 / fitted.shunt_ohm  # over_current stays measurable
    assert (TARGET / "ranges" / f"{fitted.name}.h").exists()
