"""The table of the columns of a log: name of each column, the value of a tick that it holds, its unit and its label.

Recorder, replay, plots, reports and the tuning page all read this table. To add a column, add a line here and a line
in docs/records.md. Its value must be an attribute of `Tick`, of the measurement or of the command. Units are written as
in the log file (`degC`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from operator import attrgetter
from typing import NamedTuple

from smadrive.control.loop import Tick

Row = tuple[float, ...]

_SYMBOLS = {"degC": "°C"}


class Column(NamedTuple):
    """One column of a log.

    `source` is the attribute of `Tick` that the column holds, for example `command.setpoint_mm`. `role` distinguishes
    columns of the same quantity, for example `measured` and `setpoint`. A column with `is_flag` holds 0 where the
    source is None or empty, and 1 otherwise.
    """

    source: str
    unit: str
    quantity: str
    role: str = ""
    is_flag: bool = False

    @property
    def label(self) -> str:
        """Quantity and role, for example `temperature, measured`. Without a role, only the quantity."""
        return f"{self.quantity}, {self.role}" if self.role else self.quantity

    @property
    def axis_label(self) -> str:
        """Quantity and unit, for example `temperature / °C`."""
        return f"{self.quantity} / {_SYMBOLS.get(self.unit, self.unit)}"

    @property
    def difference_unit(self) -> str:
        """Unit of the difference of two values of the column: K for temperatures, otherwise the unit of the column."""
        return self.unit.replace("degC", "K")


COLUMNS = {
    "time_s": Column("time_s", "s", "time"),
    "temperature_c": Column("measurement.temperature_c", "degC", "temperature", "measured"),
    "displacement_mm": Column("measurement.displacement_mm", "mm", "displacement", "measured"),
    "current_a": Column("measurement.current_a", "A", "current", "measured"),
    "voltage_v": Column("measurement.voltage_v", "V", "voltage", "measured"),
    "setpoint_mm": Column("command.setpoint_mm", "mm", "displacement", "setpoint"),
    "setpoint_c": Column("command.setpoint_c", "degC", "temperature", "setpoint"),
    "estimated_c": Column("command.estimated_c", "degC", "temperature", "estimated"),
    "estimated_mm": Column("command.estimated_mm", "mm", "displacement", "estimated"),
    "power_w": Column("command.power_w", "W", "power", "commanded"),
    "cooling": Column("command.cooling", "1", "heat loss", "estimated, divided by the identified"),
    "shift_c": Column("command.shift_c", "K", "shift of the transformation", "estimated"),
    "commanded_a": Column("command.commanded_a", "A", "current", "commanded"),
    "by_resistance_mm": Column("command.by_resistance_mm", "mm", "displacement", "by resistance"),
    "by_resistance_sd_mm": Column("command.by_resistance_sd_mm", "mm", "displacement", "by resistance, deviation"),
    "uses_resistance": Column("command.uses_resistance", "1", "displacement by resistance in use"),
    "sensor_replaced": Column("command.sensor_replaced", "1", "displacement sensor wrong or missing, and replaced"),
    "resistance_wrong": Column("command.resistance_wrong", "1", "displacement by resistance wrong"),
    "in_force_a": Column("measurement.in_force_a", "A", "current", "in force"),
    "temperature_age_s": Column("measurement.temperature_age_s", "s", "age of the temperature"),
    "displacement_age_s": Column("measurement.displacement_age_s", "s", "age of the displacement"),
    "late_s": Column("late_s", "s", "lateness of the tick"),
    "temperature_fault": Column("measurement.temperature_fault", "1", "temperature invalid", is_flag=True),
    "limited": Column("measurement.limits", "1", "output held back", is_flag=True),
    "tripped": Column("tripped", "1", "measurement that tripped", is_flag=True),
}


def row_getter(names: Iterable[str]) -> Callable[[Tick], Row]:
    """Return a function that returns the values of the columns `names` for a tick, in this order. Flags are 0 or 1.

    `names` must hold at least two names.
    """
    columns = [COLUMNS[name] for name in names]
    values = attrgetter(*(column.source for column in columns))
    flags = [number for number, column in enumerate(columns) if column.is_flag]

    def row(tick: Tick) -> Row:
        entries = list(values(tick))
        for flag in flags:
            entries[flag] = 1.0 if entries[flag] else 0.0
        return tuple(entries)

    return row


def fields_of(part: str) -> dict[str, str]:
    """Return the columns that hold attributes of one part of a tick, as a dict from column name to attribute name.

    `part` is `command` or `measurement`. Columns with `is_flag` are left out.
    """
    sources = {name: column.source.split(".") for name, column in COLUMNS.items() if not column.is_flag}
    return {name: source[1] for name, source in sources.items() if source[0] == part and len(source) == 2}
