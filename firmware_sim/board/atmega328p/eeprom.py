"""Writes the content of a new board's EEPROM to FILE: python3 eeprom.py SERIAL FILE

The calibration record is at address 0, with gains of 1 and offsets of 0. The serial number is at address 16.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

CALIBRATION = struct.pack("<HhHhHh", 16384, 0, 16384, 0, 16384, 0)
SERIAL_AT = 16


def sealed(record: bytes) -> bytes:
    """Return `record`, followed by the CRC-16 of Modbus over it, low byte first."""
    crc = 0xFFFF
    for byte in record:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return record + struct.pack("<H", crc)


def image(serial_number: int) -> bytes:
    """Return the first 22 bytes of the EEPROM: the calibration record, two unused bytes, and the serial number."""
    return sealed(CALIBRATION).ljust(SERIAL_AT, b"\xff") + sealed(struct.pack("<I", serial_number))


if __name__ == "__main__":
    Path(sys.argv[2]).write_bytes(image(int(sys.argv[1])))
