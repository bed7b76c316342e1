"""The samples that the loop sends to the pages: one row of numbers for each tick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import Tick

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
"""The columns of a row: measured, estimated and commanded values; `time_s` since the session began."""

Row = tuple[float, ...]
Rows = NDArray[np.float64]
"""(rows, columns)"""


def row_of(tick: Tick, began_s: float) -> Row:
    """The `COLUMNS` of a tick of a session that began at `began_s`."""
    measurement, command = tick.measurement, tick.command
    return (
        measurement.time_s - began_s,
        tick.late_s,
        measurement.temperature_c,
        measurement.displacement_mm,
        measurement.current_a,
        measurement.voltage_v,
        command.setpoint_c,
        command.setpoint_mm,
        command.estimated_c,
        command.estimated_mm,
        command.power_w,
        command.commanded_a,
    )
