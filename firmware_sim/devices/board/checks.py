"""The checks of a board: faults of its sensors and of the heater current, and the limits (docs/sma-reference.md).

All values are counts of the registers: temperatures in 0.01 °C, `temperature_max` in 0.1 °C, currents in 0.1 mA. Times
are in ms.
"""

from __future__ import annotations

from enum import IntFlag

from firmware_sim.devices.board.readings import NO_READING, NO_TEMPERATURE, BoardFault, BoardReadings

DERATE = 500
DEBOUNCE_MS = 30
COLD_JUNCTION = range(-2000, 8501)
CURRENT_MARGIN = 500
PER_LIMIT = 10
"""Factor from the counts of `temperature_max` (0.1 °C) to the counts of a temperature (0.01 °C)."""


class BoardLimit(IntFlag):
    """The bits of the register `limits`: the limits that hold the current back now."""

    CURRENT_MAX = 1 << 0
    SUPPLY = 1 << 1
    TEMPERATURE = 1 << 2


def sensor_faults(readings: BoardReadings, temperature_max: int) -> int:
    """Return the bits of the faults that one set of readings shows. They need no debounce."""
    faults = readings.detected
    if readings.temperature >= temperature_max * PER_LIMIT:
        faults |= BoardFault.OVER_TEMPERATURE.value
    if readings.cold_junction not in COLD_JUNCTION and readings.cold_junction != NO_TEMPERATURE:
        faults |= BoardFault.COLD_JUNCTION_RANGE.value
    if NO_READING in (readings.current, readings.voltage):
        faults |= BoardFault.SENSOR_BUS.value
    return faults


class CurrentCheck:
    """Compares the measured current with the set current. A fault needs wrong values for 30 ms (debounce).

    over_current   measured current > 1.1 · set current + 50 mA: a shorted switch
    heater_open    measured current < half the set current, with a set current > 50 mA: a broken wire

    A current without a reading is not wrong.
    """

    def __init__(self) -> None:
        self._wrong_ms = 0

    def restart(self) -> None:
        """Begin the debounce again."""
        self._wrong_ms = 0

    def faults(self, measured: int, set_current: int, elapsed_ms: int) -> int:
        """Return the bit of the fault, 0 without a fault. `elapsed_ms` is the time since the previous check."""
        is_known = measured != NO_READING
        excess = is_known and 10 * measured > 11 * set_current + 10 * CURRENT_MARGIN
        lack = is_known and set_current > CURRENT_MARGIN and 2 * measured < set_current
        self._wrong_ms = self._wrong_ms + elapsed_ms if excess or lack else 0
        if self._wrong_ms < DEBOUNCE_MS:
            return 0
        return (BoardFault.OVER_CURRENT if excess else BoardFault.HEATER_OPEN).value


def temperature_limit(temperature: int, temperature_max: int, current_max: int) -> int | None:
    """Return the highest current at this temperature, or None if the temperature does not limit the current.

    The limit falls from `current_max` to 0 over the last 5 °C below `temperature_max`. It is 0 without a valid
    temperature.
    """
    margin = temperature_max * PER_LIMIT - temperature
    if temperature == NO_TEMPERATURE or margin <= 0:
        return 0
    return current_max * margin // DERATE if margin < DERATE else None
