"""Counts of the registers that a host writes, by role; start of the sequence (docs/sma-reference.md, Map)."""

from __future__ import annotations

from random import Random

from firmware_sim.devices.board.calibration import GAIN_ONE
from firmware_sim.devices.board.readings import AMPERE, VOLT

SEQUENCE_MIN = 0x0100
SCALES = {
    "watchdog_s": 1000,
    "temperature_max": 10,
    "current_max": AMPERE,
    "heater_current": AMPERE,
    "current_gain": GAIN_ONE,
    "current_offset": AMPERE,
    "voltage_gain": GAIN_ONE,
    "voltage_offset": VOLT,
    "source_gain": GAIN_ONE,
    "source_offset": AMPERE,
}
"""Counts for one unit of a role that can be written; without an entry, 1."""
SETTINGS = ("watchdog_s", "temperature_max", "current_max")
CONSTANTS = tuple(role for role in SCALES if role.endswith(("_gain", "_offset")))


def sequence_start(random: Random) -> int:
    """Return a random number with which the sequence of a board may start."""
    start = random.getrandbits(16)
    return start if start >= SEQUENCE_MIN else start + SEQUENCE_MIN


def count_of(role: str, value: float) -> int:
    """Return the count of the register with this role that stands for `value`."""
    return round(value * SCALES[role])
