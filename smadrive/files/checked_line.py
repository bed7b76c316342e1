"""A line of a file that only grows: a JSON object with a CRC-32 of its other fields, which shows damage."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from zlib import crc32

CHECKSUM = "crc32"


def checked_line(fields: Mapping[str, Any]) -> bytes:
    """Return the line of a JSON object with these fields, with its checksum and its end."""
    return json.dumps({**fields, CHECKSUM: _checksum(fields)}).encode() + b"\n"


def fields_of_line(line: bytes) -> dict[str, Any]:
    """Return the fields of a line, without its checksum. ValueError when the line is incomplete or damaged."""
    try:
        fields = json.loads(line)
    except RecursionError:
        raise ValueError("damaged") from None
    if not isinstance(fields, dict) or fields.pop(CHECKSUM, None) != _checksum(fields):
        raise ValueError("damaged")
    return fields


def _checksum(fields: Mapping[str, Any]) -> int:
    return crc32(json.dumps(fields).encode())
