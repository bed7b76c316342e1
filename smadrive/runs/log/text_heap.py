"""Texts of variable length in HDF5's global heap, as the first logs of version 0.1 have them.

A heap consists of collections, and a collection of objects. HDF5's own reader loops for ever in some damaged heaps; the
reader in this module rejects an object that does not fit into its collection.
Format: "HDF5 File Format Specification", section III.E, Global Heap.
"""

from __future__ import annotations

import os
import struct

_REFERENCE = struct.Struct("<IQI")
_COLLECTION = struct.Struct("<4sB3xQ")
_OBJECT = struct.Struct("<HH4xQ")

MOST_BYTES = 1 << 26
"""Largest size of a collection in bytes. The collection of a log has about ten thousand bytes."""


def heap_text(handle: int, offset: int | None) -> bytes:
    """Return the bytes of the text to which a dataset refers.

    `handle` is the descriptor of the open file, `offset` the position of the dataset's value in the file, in bytes.
    ValueError or struct.error when the heap is damaged.
    """
    if offset is None:
        raise ValueError("the file holds no bytes for a text")
    length, address, index = _REFERENCE.unpack(os.pread(handle, _REFERENCE.size, offset))
    collection = _collection(handle, address)
    place = _COLLECTION.size
    while place + _OBJECT.size <= len(collection):
        number, _, size = _OBJECT.unpack_from(collection, place)
        place += _OBJECT.size
        if number == index and length <= size:
            return collection[place : place + length]
        if number == 0:
            break
        place += -(-size // 8) * 8
    raise ValueError(f"no text {index} in the heap at {address}")


def _collection(handle: int, address: int) -> bytes:
    """Return the bytes of the collection at `address`, including its header."""
    signature, _, size = _COLLECTION.unpack(os.pread(handle, _COLLECTION.size, address))
    if signature != b"GCOL" or size > MOST_BYTES:
        raise ValueError(f"no heap of texts at {address}")
    return os.pread(handle, size, address)
