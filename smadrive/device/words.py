"""16-bit words of the bus <-> raw numbers: types, word order, raw patterns.

A 32-bit number takes two registers; `word_order` "big" means that its high word comes first. A coil or discrete input
is one word, 0 or 1.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Literal

Kind = Literal["uint16", "int16", "uint32", "int32", "float32", "bool", "string"]
Order = Literal["big", "little"]

_CODES: dict[Kind, str] = {"uint32": "I", "int32": "i", "float32": "f"}
_FLOAT32_MAX = 3.4028234663852886e38

RANGES: dict[Kind, tuple[float, float]] = {
    "bool": (0, 1),
    "uint16": (0, 0xFFFF),
    "int16": (-0x8000, 0x7FFF),
    "uint32": (0, 0xFFFFFFFF),
    "int32": (-0x80000000, 0x7FFFFFFF),
    "float32": (-_FLOAT32_MAX, _FLOAT32_MAX),
}


def is_wide(kind: Kind) -> bool:
    """Whether a number of this type takes two registers."""
    return kind in _CODES


def unpack(kind: Kind, order: Order, words: Sequence[int]) -> int | float:
    """The raw number in `words`, as they come from the bus."""
    if kind == "int16":
        return words[0] - 0x10000 if words[0] & 0x8000 else words[0]
    if not is_wide(kind):
        return words[0]
    high, low = words if order == "big" else (words[1], words[0])
    raw: int | float = struct.unpack(f">{_CODES[kind]}", struct.pack(">HH", high, low))[0]
    return raw


def pack(kind: Kind, order: Order, raw: float) -> tuple[int, ...]:
    """The words of a raw number that lies within the type's range."""
    if not is_wide(kind):
        return (int(raw) & 0xFFFF,)
    high, low = struct.unpack(">HH", struct.pack(f">{_CODES[kind]}", raw))
    return (high, low) if order == "big" else (low, high)


def pattern(kind: Kind, order: Order, bits: int) -> tuple[int, ...]:
    """The words of a raw pattern, written as a number of the type or as its unsigned bits; ValueError: too wide."""
    width = 32 if is_wide(kind) else 16
    if not -(1 << width - 1) <= bits < 1 << width:
        raise ValueError(f"the pattern {bits:#x} does not fit {kind}")
    words = struct.unpack(f">{width // 16}H", (bits & (1 << width) - 1).to_bytes(width // 8, "big"))
    return words if order == "big" else words[::-1]


def text(words: Sequence[int]) -> str:
    """The ASCII text of a string register: two characters a word, padding stripped."""
    return struct.pack(f">{len(words)}H", *words).decode("ascii", "replace").strip("\0 ")
