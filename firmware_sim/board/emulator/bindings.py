"""The interface of the emulator's shared library, `chips/emulator.h`, for ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from ctypes import (
    POINTER,
    c_char_p,
    c_double,
    c_int,
    c_int32,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from functools import cache
from typing import Any

from firmware_sim.board.emulator.build import emulator_library


def _fields(names: str, of_type: Any) -> Iterable[tuple[str, Any]]:
    return [(name, of_type) for name in names.split()]


class World(ctypes.Structure):
    """The inputs of the pins and chips of the board: `struct emulator_world`."""

    _fields_ = (
        *_fields("temperature_c cold_junction_c current_a wire_top_v wire_bottom_v displacement_v", c_double),
        *_fields("full_scale_a shunt_ohm", c_double),
        *_fields("converter stuck dac_absent top_meter_absent bottom_meter_absent", c_int32),
        *_fields("estop_open displacement_fitted unpowered", c_int32),
    )


class Probes(ctypes.Structure):
    """Times in cycles, and numbers of events, that the emulator measures: `struct emulator_probes`."""

    _fields_ = (
        *_fields("safety_longest safety_count safety_latency_min safety_latency_max off_longest", c_uint64),
        *_fields("overruns resets_by_watchdog enabled_at disabled_at received_at", c_uint64),
    )


class SentByte(ctypes.Structure):
    """A byte that the board has sent, and the cycle in which it was complete: `struct emulator_byte`."""

    _fields_ = (("cycle", c_uint64), ("value", c_uint8))


_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "create": (c_void_p, (c_char_p, c_uint32)),
    "destroy": (None, (c_void_p,)),
    "world": (POINTER(World), (c_void_p,)),
    "probes": (POINTER(Probes), (c_void_p,)),
    "ram": (POINTER(c_uint8), (c_void_p,)),
    "cycle": (c_uint64, (c_void_p,)),
    "run": (c_int, (c_void_p, c_uint64)),
    "step": (c_int, (c_void_p, c_uint64)),
    "reset": (None, (c_void_p, c_int)),
    "send": (c_size_t, (c_void_p, c_char_p, c_size_t)),
    "unsent": (c_size_t, (c_void_p,)),
    "receive": (c_size_t, (c_void_p, POINTER(SentByte), c_size_t)),
    "sink_a": (c_double, (c_void_p,)),
    "write_eeprom": (None, (c_void_p, c_uint16, c_char_p, c_uint16)),
}


@cache
def load_library() -> ctypes.CDLL:
    """Build the library if necessary, load it, and declare its functions. ConfigError if it cannot be built."""
    library = ctypes.CDLL(str(emulator_library()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, f"emulator_{name}")
        function.restype, function.argtypes = result, arguments
    return library
