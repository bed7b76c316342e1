"""The conversion between 16-bit words of the bus and raw numbers: types, word order, raw patterns.

A 32-bit number takes two registers; `word_order` "big" means that its high word comes first. A coil or discrete input
is one word, 0 or 1.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Literal

Kind = Literal["uint16", "int16", "uint32", "int32", "float32", "bool", "string"]
Order = Literal["big", "little"]

_PAIR = struct.Struct(">HH")
_WIDE = {"uint32": struct.Struct(">I"), "int32": struct.Struct(">i"), "float32": struct.Struct(">f")}
_FLOAT32_MAX = 3.4028234663852886e38

RANGES: dict[Kind, tuple[float, float]] = {
    "bool": (0, 1),
    "uint16": (0, 0xFFFF),
    "int16": (-0x8000, 0x7FFF),
    "uint32": (0, 0xFFFFFFFF),
    "int32": (-0x80000000, 0x7FFFFFFF),
    "float32": (-_FLOAT32_MAX, _FLOAT32_MAX),
}

NOT_A_NUMBER: tuple[Kind, ...] = ("float32", "string")
"""Types with raw patterns that are not finite numbers."""


def is_wide(kind: Kind) -> bool:
    """Return True if a number of this type occupies two registers."""
    return kind in _WIDE


def unpacker(kind: Kind, order: Order) -> Callable[[Sequence[int]], int | float]:
    """Return a function that converts words, in the order of the bus, to a raw number."""
    if kind in _WIDE:
        join, number, step = _PAIR.pack, _WIDE[kind].unpack, 1 if order == "big" else -1
        return lambda words: number(join(*words[::step]))[0]
    if kind == "int16":
        return lambda words: words[0] - 0x10000 if words[0] & 0x8000 else words[0]
    return itemgetter(0)


def packer(kind: Kind, order: Order) -> Callable[[float], tuple[int, ...]]:
    """Return a function that converts a raw number within the type's range to words."""
    if kind in _WIDE:
        part, number, step = _PAIR.unpack, _WIDE[kind].pack, 1 if order == "big" else -1
        return lambda raw: part(number(raw))[::step]
    return lambda raw: (int(raw) & 0xFFFF,)


def pattern(kind: Kind, order: Order, bits: int) -> tuple[int, ...]:
    """Return the words of a raw pattern; ValueError when it has too many bits for the type.

    `bits` is a number of the type, or the same pattern as an unsigned number.
    """
    width = 32 if is_wide(kind) else 16
    if not -(1 << width - 1) <= bits < 1 << width:
        raise ValueError(f"the pattern {bits:#x} does not fit {kind}")
    words = struct.unpack(f">{width // 16}H", (bits & (1 << width) - 1).to_bytes(width // 8, "big"))
    return words if order == "big" else words[::-1]


def text(words: Sequence[int]) -> str:
    """Return the ASCII text of a string register, without padding. Each word holds two characters."""
    return struct.pack(f">{len(words)}H", *words).decode("ascii", "replace").strip("\0 ")
