"""Builds and loads the shared library of the board core. It is built once for each content of its sources.

If the environment variable SMADRIVE_BOARD_LIBRARY is set, the library at this path is loaded instead, for example one
that was built with a sanitizer or for coverage.
"""

from __future__ import annotations

import ctypes
import os
import shutil
from ctypes import (
    POINTER,
    Structure,
    c_bool,
    c_char_p,
    c_int16,
    c_int32,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_void_p,
)
from functools import cache
from pathlib import Path

from firmware_sim.board.build import Product, built
from smadrive.errors import ConfigError

FOLDER = Path(__file__).parent
CORE, NATIVE = FOLDER / "core", FOLDER / "native"
PREBUILT = "SMADRIVE_BOARD_LIBRARY"
WORDS = 71
"""The number of addresses from 0 to the last register, including addresses without a register."""


class Hardware(Structure):
    """`struct board_hardware` of board.h."""

    _fields_ = (
        ("firmware_version", c_uint16),
        ("serial_number", c_uint32),
        ("watchdog_ms", c_uint16),
        ("temperature_max", c_uint16),
        ("supply_limit", c_uint16),
        ("sequence_start", c_uint16),
        ("unit_id", c_uint8),
    )


class Inputs(Structure):
    """`struct board_inputs` of board.h."""

    _fields_ = (
        ("temperature", c_int16),
        ("cold_junction", c_int16),
        ("current", c_uint16),
        ("voltage", c_uint16),
        ("displacement", c_int32),
        ("sample_counter", c_uint16),
        ("detected", c_uint16),
    )


class Outputs(Structure):
    """`struct board_outputs` of board.h."""

    _fields_ = (("current", c_uint16), ("enable", c_bool), ("alive", c_bool))


class View(Structure):
    """`struct native_view` of native.h."""

    _fields_ = tuple(
        (name, c_uint16) for name in ("faults", "mode", "limits", "sequence", "commanded", "set_current", "output")
    )


def missing_tool() -> str | None:
    """Return the name of the tool that is missing for the build, or None."""
    return next((tool for tool in ("make", "gcc") if shutil.which(tool) is None), None)


def _check_tools() -> None:
    if (tool := missing_tool()) is not None:
        raise ConfigError(
            "the board core cannot be built",
            where=f"program '{tool}'",
            value="not found",
            cure="install it (Debian packages gcc and make), or use the implementation python",
        )


LIBRARY = Product("libboard.so", "the board core", NATIVE, (CORE, NATIVE), _check_tools)


@cache
def board_library() -> ctypes.CDLL:
    """Return the library. Build it first if necessary. ConfigError if a tool is missing or the build fails."""
    library = ctypes.CDLL(os.environ.get(PREBUILT) or str(built(LIBRARY)))
    _declare(library)
    return library


def _declare(library: ctypes.CDLL) -> None:
    """Declare the types of the functions that Python calls."""
    buffer, board = c_char_p, c_void_p
    library.native_size.restype = c_size_t
    for name, result, arguments in (
        ("board_power_up", None, (board, POINTER(Hardware), buffer)),
        ("board_tick", None, (board, POINTER(Inputs), c_uint32, POINTER(Outputs))),
        ("board_poll", None, (board, c_uint32)),
        ("board_take_calibration", c_bool, (board, buffer)),
        ("native_receive", c_size_t, (board, buffer, c_size_t, c_uint32, buffer, c_size_t)),
        ("native_pause", c_size_t, (board, c_uint32, buffer, c_size_t)),
        ("native_registers", None, (board, c_uint32, POINTER(c_uint16 * WORDS))),
        ("native_observe", None, (board, POINTER(View))),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
