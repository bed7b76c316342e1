"""Texts of variable length in HDF5's global heap, as logs of version 0.1 have them.

HDF5's own reader searches some damaged heaps without end. This one refuses whatever does not fit into its collection.
Format: "HDF5 File Format Specification", section III.E, Global Heap.
"""

from __future__ import annotations

import os
import struct

_REFERENCE = struct.Struct("<IQI")
_COLLECTION = struct.Struct("<4sB3xQ")
_OBJECT = struct.Struct("<HH4xQ")

MOST_BYTES = 1 << 26
"""Of one collection; that of a log has some ten thousand."""


def heap_text(handle: int, offset: int | None) -> bytes:
    """The text that the dataset at `offset` of an open file refers to. ValueError, struct.error when there is none."""
    if offset is None:
        raise ValueError("a text has no place in the file")
    length, address, wanted = _REFERENCE.unpack(os.pread(handle, _REFERENCE.size, offset))
    signature, _, size = _COLLECTION.unpack(os.pread(handle, _COLLECTION.size, address))
    if signature != b"GCOL" or size > MOST_BYTES:
        raise ValueError(f"no heap of texts at {address}")
    collection = os.pread(handle, size, address)
    place = _COLLECTION.size
    while place + _OBJECT.size <= len(collection):
        number, _, held = _OBJECT.unpack_from(collection, place)
        place += _OBJECT.size
        if number == wanted and length <= held:
            return collection[place : place + length]
        if number == 0:
            break
        place += -(-held // 8) * 8
    raise ValueError(f"no text {wanted} in the heap at {address}")
