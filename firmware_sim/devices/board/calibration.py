"""The calibration of a board: six constants, and the record that stores them (docs/sma-reference.md, Calibration).

    measured = reading · gain / 16384 + offset        output of the source = set current · gain / 16384 + offset

All values are counts. Results are rounded down and kept within 0 to 65535, measured values within 0 to 65534. A set
current of 0 always gives an output of 0. The record holds the six constants and a checksum over them.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from firmware_sim.devices.board.readings import NO_READING
from smadrive.modbus.framing import rtu

GAIN_ONE = 16384
GAINS = range(12288, 20481)
OFFSETS = range(-500, 501)
_CONSTANTS = struct.Struct("<HhHhHh")


class Correction(NamedTuple):
    """Gain and offset of one quantity. The gain is in units of 2⁻¹⁴, the offset in counts."""

    gain: int = GAIN_ONE
    offset: int = 0

    def applied(self, count: int) -> int:
        """Return a count after the correction."""
        return min(max((count * self.gain >> 14) + self.offset, 0), 0xFFFF)

    def measured(self, count: int) -> int:
        """Return the count of a measured value after the correction; NO_READING for NO_READING, and for it only."""
        return NO_READING if count == NO_READING else min(self.applied(count), NO_READING - 1)


class BoardCalibration(NamedTuple):
    """The constants of measured current, measured voltage, and current source."""

    current: Correction = Correction()
    voltage: Correction = Correction()
    source: Correction = Correction()

    def record(self) -> bytes:
        """Return the record for the storage: six words and the CRC over them, all with their low byte first."""
        constants = _CONSTANTS.pack(*self.current, *self.voltage, *self.source)
        return constants + rtu.crc(constants)

    @classmethod
    def of_record(cls, record: bytes) -> BoardCalibration | None:
        """Return the constants in `record`. Return None if the checksum or a constant is wrong."""
        constants = record[: _CONSTANTS.size]
        words = _CONSTANTS.unpack(constants)
        fit = all(gain in GAINS for gain in words[::2]) and all(offset in OFFSETS for offset in words[1::2])
        if not fit or rtu.crc(constants) != record[_CONSTANTS.size :]:
            return None
        return cls(Correction(*words[0:2]), Correction(*words[2:4]), Correction(*words[4:6]))

    def changed(self, role: str, value: int) -> BoardCalibration:
        """Return the calibration with one constant set to `value`, in counts.

        `role` is the role of its register, such as `current_gain`.
        """
        part, _, constant = role.partition("_")
        correction: Correction = getattr(self, part)
        return self._replace(**{part: correction._replace(**{constant: value})})

    def constant(self, role: str) -> int:
        """Return the constant whose register has this role, in counts."""
        part, _, constant = role.partition("_")
        return int(getattr(getattr(self, part), constant))
