"""Scales of the registers that a host writes, and the first sequence number (docs/sma-reference.md, Map)."""

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
"""Counts for one unit of a quantity, by the role of its register."""
SETTINGS = ("watchdog_s", "temperature_max", "current_max")
CONSTANTS = tuple(role for role in SCALES if role.endswith(("_gain", "_offset")))


def sequence_start(random: Random) -> int:
    """Return a random first sequence number of a board, from 256 to 65535."""
    start = random.getrandbits(16)
    return start if start >= SEQUENCE_MIN else start + SEQUENCE_MIN


def count_of(role: str, value: float) -> int:
    """Return `value` in counts of the register with this role. KeyError for a role without a scale."""
    return round(value * SCALES[role])
