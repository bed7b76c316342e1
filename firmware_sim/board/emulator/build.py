"""Builds the emulator and the firmware with `make`, when they are needed.

The results lie in the user's cache folder, in a folder for each state of the sources and each set of variables.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from firmware_sim.board.library import cache_folder
from firmware_sim.config import Board
from smadrive.errors import ConfigError

EMULATOR = Path(__file__).parent / "library"
TARGET = Path(__file__).parents[1] / "atmega328p"
CORE = TARGET.parent / "core"
TOOLS = ("make", "gcc", "avr-gcc")
HEADERS = (Path("/usr/include/simavr/sim_avr.h"), Path("/usr/include/libelf.h"))
AVR_HEADER = Path("/usr/lib/avr/include/avr/io.h")
PACKAGES = "make gcc gcc-avr avr-libc libsimavr-dev libelf-dev"
_DEFINE = re.compile(r"^#define (\w+) (\d+)u", re.MULTILINE)
_SOURCES = ("*.c", "*.h", "Makefile")


def missing_tools() -> list[str]:
    """Return the programs and headers that building the emulator and the firmware needs and this computer lacks."""
    lacking = [tool for tool in TOOLS if shutil.which(tool) is None]
    return lacking + [str(header) for header in (*HEADERS, AVR_HEADER) if not header.exists()]


class Range(NamedTuple):
    """A range of currents of the board: a file in `atmega328p/ranges`."""

    name: str
    supply_limit_a: float
    full_scale_a: float
    shunt_ohm: float


def ranges() -> list[Range]:
    """Return the ranges of the board, the smallest first."""
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


def emulator_library() -> Path:
    """Return the shared library of the emulator, which is built if necessary. ConfigError if that fails."""
    return _built("libemulator.so", EMULATOR, (EMULATOR,))


def firmware_file(board: Board, *, hang_hook: bool = False) -> Path:
    """Return the firmware for this board as an ELF file, which is built if necessary. ConfigError if that fails.

    With `hang_hook` the main loop hangs while the register GPIOR0 is not zero.
    """
    counts = {
        "SUPPLY_LIMIT": round(board.supply_limit_a * 1e4),
        "TEMPERATURE_MAX": round(board.temperature_max_c * 10),
        "WATCHDOG_MS": round(board.watchdog_s * 1e3),
    }
    defines = [f"-D{key}={count}u" for key, count in counts.items()] + ["-DHANG_HOOK"] * hang_hook
    variables = (f"RANGE={range_for(board.supply_limit_a).name}", "DEFINES=" + " ".join(defines))
    return _built("board.elf", TARGET, (TARGET, TARGET / "ranges", CORE), *variables)


def _built(name: str, folder: Path, sources: tuple[Path, ...], *variables: str) -> Path:
    """Return the file `name` that `make` builds in `folder` from the files in `sources`."""
    target = cache_folder() / f"{Path(name).stem}-{_digest(sources, variables)}"
    if not (target / name).exists():
        _make(name, folder, variables, target)
    return target / name


def _digest(sources: tuple[Path, ...], variables: tuple[str, ...]) -> str:
    files = sorted(path for folder in sources for pattern in _SOURCES for path in folder.glob(pattern))
    return sha256(b"\0".join((*map(str.encode, variables), *(path.read_bytes() for path in files)))).hexdigest()[:16]


def _make(name: str, folder: Path, variables: tuple[str, ...], target: Path) -> None:
    if missing := missing_tools():
        raise ConfigError(
            "the emulated board needs programs that are not installed",
            value=", ".join(missing),
            cure=f"apt-get install {PACKAGES}",
        )
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as building:
        command = ["make", "-s", "-C", str(folder), f"BUILD={building}", *variables]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode:
            raise ConfigError("the emulated board cannot be built", where=folder, value=made.stderr.strip()[-2000:])
        target.mkdir(exist_ok=True)
        (Path(building) / name).replace(target / name)  # at once, so that no other process loads a part of it
