"""The samples that the loop sends to pages and subscribers: one row of numbers for each tick."""

from __future__ import annotations

from math import nan

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import Tick
from smadrive.runs.columns import Row, row_getter

COLUMNS = (
    "time_s",
    "late_s",
    "temperature_c",
    "displacement_mm",
    "current_a",
    "voltage_v",
    "setpoint_c",
    "setpoint_mm",
    "estimated_c",
    "estimated_mm",
    "power_w",
    "commanded_a",
)
"""The columns of a row: measured, estimated and commanded values. `time_s` is the time since the loop began.

`displacement_mm` is NaN while the displacement sensor is replaced, because its readings are wrong then.
"""

Rows = NDArray[np.float64]
"""An array of shape (rows, columns)."""

COLUMN = {name: number for number, name in enumerate(COLUMNS)}
"""The number of each column in a row."""

DISPLACEMENT = COLUMN["displacement_mm"]

_values_of = row_getter(COLUMNS)


def row_of(tick: Tick, began_s: float) -> Row:
    """Return the values of `COLUMNS` for a tick. `began_s` is the time of the clock when the loop began."""
    _, *values = _values_of(tick)
    if tick.command.sensor_replaced:
        values[DISPLACEMENT - 1] = nan
    return (tick.measurement.time_s - began_s, *values)
