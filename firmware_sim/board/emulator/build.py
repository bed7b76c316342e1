"""Builds the emulator and the firmware when they are needed, and reads the current ranges of the board."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import NamedTuple

from firmware_sim.board.build import Product, built
from firmware_sim.config import Board
from smadrive.errors import ConfigError

CHIPS = Path(__file__).parent / "chips"
TARGET = Path(__file__).parents[1] / "atmega328p"
CORE = TARGET.parent / "core"
TOOLS = ("make", "gcc", "avr-gcc")
HEADERS = (Path("/usr/include/simavr/sim_avr.h"), Path("/usr/include/libelf.h"))
AVR_HEADER = Path("/usr/lib/avr/include/avr/io.h")
PACKAGES = "make gcc gcc-avr avr-libc libsimavr-dev libelf-dev"
_DEFINE = re.compile(r"^#define (\w+) (\d+)u", re.MULTILINE)


def missing_tools() -> list[str]:
    """Return the missing programs and headers, of those that the build of the emulator and the firmware needs."""
    lacking = [tool for tool in TOOLS if shutil.which(tool) is None]
    return lacking + [str(header) for header in (*HEADERS, AVR_HEADER) if not header.exists()]


class Range(NamedTuple):
    """A current range of the board, read from a file in `atmega328p/ranges`.

    supply_limit_a   highest set current
    full_scale_a     current of the sink at the DAC code 4096
    shunt_ohm        shunt of the meter at the upper end of the wire
    """

    name: str
    supply_limit_a: float
    full_scale_a: float
    shunt_ohm: float


def ranges() -> list[Range]:
    """Return the current ranges of the board, the smallest first."""
    found = [_range_of(path) for path in (TARGET / "ranges").glob("*.h")]
    return sorted(found, key=lambda one: one.supply_limit_a)


def range_for(current_a: float) -> Range:
    """Return the smallest range that reaches `current_a`. ConfigError if there is none."""
    fitting = [one for one in ranges() if one.supply_limit_a >= current_a]
    if not fitting:
        raise ConfigError(
            "no range of the board reaches this current",
            where="supply_limit_a",
            value=current_a,
            limit=f"at most {ranges()[-1].supply_limit_a:g} A",
            cure="choose a lower current, or the implementation python",
        )
    return fitting[0]


def _range_of(path: Path) -> Range:
    counts = {name: int(count) for name, count in _DEFINE.findall(path.read_text(encoding="utf-8"))}
    return Range(
        path.stem, counts["SUPPLY_LIMIT"] / 1e4, counts["SOURCE_FULL_SCALE"] / 1e4, counts["SHUNT_MICROOHM"] / 1e6
    )


def _check_tools() -> None:
    if missing := missing_tools():
        raise ConfigError(
            "the emulated board needs programs or headers that are not installed",
            value=", ".join(missing),
            cure=f"apt-get install {PACKAGES}",
        )


EMULATOR = Product("libemulator.so", "the emulated board", CHIPS, (CHIPS,), _check_tools)
FIRMWARE = Product("board.elf", "the emulated board", TARGET, (TARGET, TARGET / "ranges", CORE), _check_tools)


def emulator_library() -> Path:
    """Return the path of the emulator's shared library. Build it first if necessary. ConfigError if that fails."""
    return built(EMULATOR)


def firmware_file(board: Board, *, hang_hook: bool = False) -> Path:
    """Return the path of the firmware for this board, an ELF file. Build it first if necessary.

    With `hang_hook` the main loop hangs while the register GPIOR0 is not zero. ConfigError if no current range is large
    enough, or the build fails.
    """
    counts = {
        "SUPPLY_LIMIT": round(board.supply_limit_a * 1e4),
        "TEMPERATURE_MAX": round(board.temperature_max_c * 10),
        "WATCHDOG_MS": round(board.watchdog_s * 1e3),
    }
    defines = [f"-D{key}={count}u" for key, count in counts.items()] + ["-DHANG_HOOK"] * hang_hook
    return built(FIRMWARE, f"RANGE={range_for(board.supply_limit_a).name}", "DEFINES=" + " ".join(defines))
