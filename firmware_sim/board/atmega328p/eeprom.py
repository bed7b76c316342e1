"""Write the image of a new board's EEPROM: calibration constants 1 and 0 at address 0, serial number at address 16.

python3 eeprom.py SERIAL FILE
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

CALIBRATION = struct.pack("<HhHhHh", 16384, 0, 16384, 0, 16384, 0)
SERIAL_AT = 16


def sealed(record: bytes) -> bytes:
    """Return the record with its CRC-16 of Modbus, low byte first."""
    crc = 0xFFFF
    for byte in record:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return record + struct.pack("<H", crc)


def image(serial_number: int) -> bytes:
    """Return the first bytes of the EEPROM."""
    return sealed(CALIBRATION).ljust(SERIAL_AT, b"\xff") + sealed(struct.pack("<I", serial_number))


if __name__ == "__main__":
    Path(sys.argv[2]).write_bytes(image(int(sys.argv[1])))
