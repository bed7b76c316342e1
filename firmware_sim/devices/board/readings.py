"""The readings of a board from its sensors, in the counts of its registers (docs/sma-reference.md).

The board in Python and the C core on this computer get the same counts, so their registers can agree to the last bit.
"""

from __future__ import annotations

from enum import IntFlag
from math import isnan
from typing import NamedTuple

from firmware_sim.sensors.sensors import Sensors

NO_TEMPERATURE = -0x8000
NO_READING = 0xFFFF
"""Count of a current or voltage without a reading."""
AMPERE, VOLT, DEGREE, MILLIMETRE = 10_000, 1_000, 100, 10_000
"""Counts of the registers for 1 A, 1 V, 1 °C and 1 mm."""
COUNT_C, COUNT_A, COUNT_V = 0.01, 0.0001, 0.001
"""One count of the registers in °C, A and V. A reading in counts is value / count, rounded as in a profile's codec."""


class BoardFault(IntFlag):
    """The bits of the register `faults`. Each bit is latched."""

    WATCHDOG = 1 << 0
    OVER_TEMPERATURE = 1 << 1
    THERMOCOUPLE_OPEN = 1 << 2
    THERMOCOUPLE_SHORT = 1 << 3
    COLD_JUNCTION_RANGE = 1 << 4
    OVER_CURRENT = 1 << 5
    HEATER_OPEN = 1 << 6
    ESTOP = 1 << 7
    SENSOR_BUS = 1 << 8
    ACTUATOR = 1 << 9
    SELF_TEST = 1 << 10


DETECTED = {
    "open": BoardFault.THERMOCOUPLE_OPEN,
    "short": BoardFault.THERMOCOUPLE_SHORT,
    "pressed": BoardFault.ESTOP,
    "silent": BoardFault.SENSOR_BUS,
    "stuck": BoardFault.ACTUATOR,
}
"""The fault for each finding in `Sensors.findings`."""


class BoardReadings(NamedTuple):
    """The readings for one check, in counts. `detected` has the bits of the faults that the hardware itself detects."""

    temperature: int
    cold_junction: int
    current: int
    voltage: int
    sample_counter: int
    detected: int


def board_readings(sensors: Sensors) -> BoardReadings:
    """Return the present readings of a board, before its calibration.

    The meters of current and voltage are read together. If one does not answer, or the sensor bus is silent, current
    and voltage are `NO_READING`.
    """
    detected = 0
    for finding in sensors.findings:
        detected |= DETECTED[finding].value
    is_lost = isnan(sensors.current_a) or isnan(sensors.voltage_v)
    is_measured = not (is_lost or detected & BoardFault.SENSOR_BUS)
    return BoardReadings(
        NO_TEMPERATURE if sensors.unreadable else _count(sensors.temperature_c / COUNT_C, -0x7FFF, 0x7FFF),
        _count(sensors.cold_junction_c / COUNT_C, -0x7FFF, 0x7FFF),
        _count(sensors.current_a / COUNT_A, 0, NO_READING - 1) if is_measured else NO_READING,
        _count(sensors.voltage_v / COUNT_V, 0, NO_READING - 1) if is_measured else NO_READING,
        sensors.conversions & 0xFFFF,
        detected,
    )


def _count(exact: float, lowest: int, highest: int) -> int:
    return min(max(round(exact), lowest), highest)
