"""The readings of a wire for bluesky: names, units and alarms."""

from __future__ import annotations

from collections.abc import Iterable
from math import nan
from operator import attrgetter
from typing import Any, NamedTuple

from smadrive.control.loop import Tick
from smadrive.runs.columns import COLUMNS

PRECISION = {
    "displacement_mm": 4,
    "temperature_c": 2,
    "current_a": 4,
    "voltage_v": 3,
    "setpoint_mm": 4,
    "estimated_mm": 4,
}
"""The columns that are read, and the number of their decimal places."""

MEASURED = {"displacement_mm": "displacement", "temperature_c": "temperature"}
"""The columns that only some rigs have. The value is the quantity that such a rig measures."""

OF_THE_COMMAND = ("setpoint_mm", "estimated_mm")
"""Columns from the command of the servo. They are NaN while no servo runs."""


class WireSample(NamedTuple):
    """A tick and its time since 1970-01-01 UTC, in s. `is_driven` is False if no servo ran.

    `latched` is the latched trip of the rig; None without one.
    """

    tick: Tick
    unix_s: float
    is_driven: bool = True
    latched: str | None = None


class Alarm(NamedTuple):
    """The severity of an alarm as EPICS counts it (0 none, 1 minor, 2 major, 3 invalid), and its text."""

    severity: int
    text: str


class Readings:
    """The readings of the wire `name` on a rig that measures `quantities`."""

    def __init__(self, name: str, source: str, quantities: Iterable[str]) -> None:
        self._source = source
        measured = set(quantities)
        columns = [column for column in PRECISION if MEASURED.get(column) in {None, *measured}]
        self._columns = {f"{name}_{column}": column for column in columns}
        self._values = {column: attrgetter(COLUMNS[column].source) for column in columns}

    @property
    def main(self) -> str:
        """The name of the reading that a table shows: the displacement, or its estimate without a sensor."""
        found = [key for key, column in self._columns.items() if column in {"displacement_mm", "estimated_mm"}]
        return found[0]

    def describe(self) -> dict[str, dict[str, Any]]:
        """Return the data keys of `read`."""
        return {
            key: {
                "source": f"{self._source}/{column}",
                "dtype": "number",
                "dtype_numpy": "<f8",
                "shape": [],
                "units": COLUMNS[column].unit,
                "precision": PRECISION[column],
            }
            for key, column in self._columns.items()
        }

    def read(self, sample: WireSample) -> dict[str, dict[str, Any]]:
        """Return the readings, each with its time and its alarm."""
        alarm = alarm_of(sample)
        time_and_alarm = {"timestamp": sample.unix_s, "alarm_severity": alarm.severity, "message": alarm.text}
        return {key: {"value": value, **time_and_alarm} for key, value in self.values(sample).items()}

    def values(self, sample: WireSample) -> dict[str, float]:
        """Return the values by the names of the readings. A displacement sensor that is replaced gives NaN."""
        unknown: tuple[str, ...] = () if sample.is_driven else OF_THE_COMMAND
        if sample.tick.command.sensor_replaced:
            unknown = (*unknown, "displacement_mm")
        return {
            key: nan if column in unknown else float(self._values[column](sample.tick))
            for key, column in self._columns.items()
        }

    def event(self, sample: WireSample) -> dict[str, Any]:
        """Return the sample as a partial event of bluesky: time, data and timestamps."""
        values = self.values(sample)
        return {"time": sample.unix_s, "data": values, "timestamps": dict.fromkeys(values, sample.unix_s)}


def alarm_of(sample: WireSample) -> Alarm:
    """Return the alarm of a measurement.

    invalid   the temperature, or the current and the voltage, are invalid
    major     a trip is latched, the device has latched a fault, or the displacement sensor is replaced
    minor     a limit holds the output back
    none      otherwise
    """
    tick, measurement = sample.tick, sample.tick.measurement
    invalid = measurement.temperature_fault or measurement.supply_fault
    if invalid is not None:
        return Alarm(3, invalid)
    if sample.latched is not None:
        return Alarm(2, f"latched: {sample.latched}")
    if measurement.device_faults:
        return Alarm(2, ", ".join(measurement.device_faults))
    if tick.command.sensor_replaced:
        return Alarm(2, COLUMNS["sensor_replaced"].label)
    return Alarm(1, ", ".join(measurement.limits)) if measurement.limits else Alarm(0, "")
