"""The C core: its register table, its sources, its calibration, and the liveness of the main loop."""

import re
import shutil
import struct
import subprocess

import pytest

from firmware_sim.board import library
from firmware_sim.board.core_board import CoreBoard
from firmware_sim.board.library import CORE, FOLDER, NATIVE, Hardware, Inputs, board_library
from firmware_sim.devices.board.calibration import BoardCalibration, Correction
from firmware_sim.devices.board.checks import BoardLimit
from firmware_sim.devices.board.readings import BoardFault
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.modbus.framing import rtu

PROFILE = load_profile("sma-reference")
ROW = re.compile(r"ROW\((\w+), +(\d+), (\w+), +(\w+), +([\w-]+), ([\w-]+)\)")
CONSTANT = re.compile(r"#define (\w+) (0x[0-9A-F]+|-?\d+)")
HARDWARE = {
    "firmware_version": 100,
    "serial_number": 7,
    "watchdog_ms": 500,
    "temperature_max": 1600,
    "supply_limit": 10_000,
    "sequence_start": 5,
    "unit_id": 1,
}


def ask(board, pdu, now_ms=0):
    return (board.receive(rtu.seal(1, bytes.fromhex(pdu)), now_ms) or board.pause(now_ms))[1:-2].hex(" ")


@pytest.fixture
def board():
    board = CoreBoard(Hardware(**HARDWARE), BoardCalibration().record())
    board.poll(0)
    board.tick(Inputs(2200, 2500), 0)
    return board


def text_of(*names):
    return "\n".join((CORE / name).read_text(encoding="utf-8") for name in names)


def test_register_table_agrees_with_the_profile():
    text = text_of("registers.h", "calibration.h")
    constants = {name: int(value, 0) for name, value in CONSTANT.findall(text)}

    def number(word):
        name = word.removeprefix("-")
        return (-1 if word.startswith("-") else 1) * constants.get(name, int(name) if name.isdigit() else 0)

    rows = {
        name.lower(): (int(address), kind, access, number(lowest), number(highest))
        for name, address, kind, access, lowest, highest in ROW.findall(text)
    }
    assert rows == {name: row_of(register) for name, register in PROFILE.registers.items()}


def row_of(register):
    limits = (0, 0)
    if register.writable and register.enum:
        limits = min(register.enum), max(register.enum)
    elif register.writable:
        limits = round(register.min / register.scale), round(register.max / register.scale)
    return register.address, register.type, register.access, *limits


@pytest.mark.parametrize(("register", "kind"), [("faults", "fault"), ("limits", "limit"), ("state", "mode")])
def test_names_of_bits_and_states_agree_with_the_profile(register, kind):
    body = re.search(rf"enum board_{kind} \{{(.*?)\}}", text_of("board.h"), re.DOTALL)[1]
    found = {int(bit): name.lower() for name, bit in re.findall(r"BOARD_(\w+) = (?:1u << )?(\d+)", body)}
    assert found == (PROFILE.register(register).bits or PROFILE.register(register).enum)


def test_structures_have_the_layout_of_the_compiler(tmp_path):
    program = tmp_path / "sizes.c"
    names = ("board_hardware", "board_inputs", "board_outputs", "native_view", "calibration")
    prints = "".join(f'printf("%zu ", sizeof(struct {name}));' for name in names)
    program.write_text(f'#include <stdio.h>\n#include "native.h"\nint main(void) {{ {prints} return 0; }}\n')
    subprocess.run(["gcc", f"-I{CORE}", f"-I{NATIVE}", "-o", tmp_path / "sizes", program], check=True)
    printed = subprocess.run([tmp_path / "sizes"], capture_output=True, text=True, check=True).stdout.split()
    structures = (library.Hardware, library.Inputs, library.Outputs, library.View)
    assert [int(size) for size in printed] == [*map(library.ctypes.sizeof, structures), 14]


def test_every_source_is_short_and_names_its_section():
    sections = re.findall(r"^## (.+)$", (FOLDER.parents[1] / "docs" / "sma-reference.md").read_text(), re.MULTILINE)
    for path in sorted(CORE.iterdir()):
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) < 250, path.name
        assert "docs/sma-reference.md" in text.partition("*/")[0], path.name
        assert path.name == "board.h" or any(f'"{section}"' in text.partition("*/")[0] for section in sections), path


def test_core_uses_no_heap_no_floats_and_no_conditional_code():
    for path in sorted(CORE.iterdir()):
        code = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\b(malloc|calloc|realloc|free|float|double)\b", code), path.name
        assert set(re.findall(r"#\s*if\w*.*", code)) <= {f"#ifndef {path.stem.upper()}_H"}, path.name


@pytest.mark.exhaustive
def test_analysers_have_no_findings(tmp_path):
    if shutil.which("cppcheck") is None:
        pytest.skip("needs cppcheck (Debian package cppcheck)")
    subprocess.run(["make", "-s", "-C", NATIVE, "lint", f"BUILD={tmp_path}"], check=True)


def test_main_loop_that_stands_still_is_detected(board):
    assert ask(board, "06 00 28 41 52") == "06 00 28 41 52"
    outputs = board.tick(Inputs(2200, 2500), 100)
    assert (outputs.alive, outputs.enable) == (True, True)
    outputs = board.tick(Inputs(2200, 2500), 101)
    assert (outputs.alive, outputs.enable, outputs.current) == (False, False, 0)
    assert board.view.faults == BoardFault.SELF_TEST


def test_without_a_temperature_no_current_flows(board):
    ask(board, "06 00 28 41 52")
    ask(board, "10 00 20 00 03 06 01 01 0B B8 00 01")
    assert board.tick(Inputs(2200, 2500), 10).current == 3000
    outputs = board.tick(Inputs(-0x8000, -0x8000, 3000), 20)
    assert (outputs.enable, outputs.current, board.view.faults) == (True, 0, 0)
    assert board.view.limits == BoardLimit.TEMPERATURE


HIGH_GAINS = "10 00 40 00 04 08 50 00 01 F4 50 00 01 F4"
"""Writes the highest gains and offsets of current and voltage."""


@pytest.mark.parametrize("lost", ["current", "voltage"])
def test_lost_meter_is_a_fault_and_no_calibration_makes_a_reading_of_it(board, lost):
    ask(board, HIGH_GAINS)
    board.tick(Inputs(2200, 2500, **({"current": 0, "voltage": 0} | {lost: 0xFFFF})), 10)
    assert board.view.faults == BoardFault.SENSOR_BUS
    words = {"current": "ff ff 01 f4", "voltage": "01 f4 ff ff"}
    assert ask(board, "03 00 16 00 02") == f"03 04 {words[lost]}"


def test_highest_reading_is_not_taken_for_a_lost_meter(board):
    ask(board, HIGH_GAINS)
    for now_ms in (10, 20, 30, 40):
        board.tick(Inputs(2200, 2500, current=0xFFFE, voltage=0xFFFE), now_ms)
    assert ask(board, "03 00 16 00 02") == "03 04 ff fe ff fe"
    assert board.view.faults == BoardFault.OVER_CURRENT


def test_unknown_current_is_neither_too_high_nor_too_low(board):
    for words in ("06 00 28 41 52", "10 00 20 00 03 06 01 01 0B B8 00 01"):
        ask(board, words)
    for now_ms in range(10, 80, 10):
        board.poll(now_ms)
        board.tick(Inputs(2200, 2500, current=0xFFFF), now_ms)
    assert board.view.faults == BoardFault.SENSOR_BUS


def test_board_shows_no_reading_before_its_first_tick():
    board = CoreBoard(Hardware(**HARDWARE), BoardCalibration().record())
    assert ask(board, "03 00 14 00 04") == "03 08 80 00 80 00 ff ff ff ff"


def test_calibration_is_kept_in_the_storage(board):
    assert ask(board, "10 00 40 00 06 0C 41 00 00 05 3F 00 FF FB 40 10 00 02") == "10 00 40 00 06"
    assert BoardCalibration.of_record(board.storage) == BoardCalibration()
    assert ask(board, "06 00 46 43 41") == "06 00 46 43 41"
    saved = BoardCalibration(Correction(0x4100, 5), Correction(0x3F00, -5), Correction(0x4010, 2))
    assert BoardCalibration.of_record(board.storage) == saved
    board.power_up(Hardware(**HARDWARE))
    assert ask(board, "03 00 40 00 06") == "03 0c 41 00 00 05 3f 00 ff fb 40 10 00 02"
    board.poll(0)
    board.tick(Inputs(2200, 2500, current=2000, voltage=4000), 0)
    measured = 2000 * 0x4100 // 16384 + 5, 4000 * 0x3F00 // 16384 - 5
    assert ask(board, "03 00 16 00 02") == "03 04 " + struct.pack(">2H", *measured).hex(" ")


def test_board_without_a_valid_calibration_can_be_calibrated_but_not_armed(board):
    board.storage = b"\xff" * 14
    board.power_up(Hardware(**HARDWARE))
    board.poll(0)
    board.tick(Inputs(2200, 2500), 0)
    assert board.view.faults == BoardFault.SELF_TEST
    assert ask(board, "06 00 29 43 4C") == "06 00 29 43 4c"
    assert ask(board, "06 00 28 41 52") == "86 04"
    assert ask(board, "06 00 46 43 41") == "06 00 46 43 41"
    assert ask(board, "06 00 29 43 4C") == "06 00 29 43 4c"
    assert ask(board, "06 00 28 41 52") == "06 00 28 41 52"


def test_missing_compiler_is_one_clear_error(monkeypatch, tmp_path):
    monkeypatch.delenv(library.PREBUILT, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ConfigError) as error:
        board_library.__wrapped__()
    assert error.value.where == "program 'make'"
    assert error.value.cure


def test_build_that_fails_is_a_config_error_and_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.delenv(library.PREBUILT, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", "false")
    with pytest.raises(ConfigError) as error:
        board_library.__wrapped__()
    assert error.value.where == str(NATIVE)
    assert list((tmp_path / "smadrive").iterdir()) == []
