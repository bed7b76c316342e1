"""A fit to a record in a log, in a CSV file or in memory."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import ConfigError, DataError
from smadrive.files.csv_table import read_table
from smadrive.files.kinds import LOG, TABLE
from smadrive.files.spelling import suggestion
from smadrive.identification.column_units import swap_caveats, time_caveats, unit_caveats
from smadrive.identification.resistance_fit.fit import ResistanceFit
from smadrive.identification.thermal_fit.fit import ThermalFit
from smadrive.identification.wire import AnyFit, FitSettings, identify_hysteresis, identify_wire
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.run_metadata import excitation_caveats, excitation_record, nominal_balance
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.recorded_loops import recorded_sections

INPUT, OUTPUT = "temperature_c", "displacement_mm"
"""The columns of a table from which a model is fitted, unless other columns are chosen."""

NO_CURRENT = "the record has no current and no voltage: give the log of an excitation"
"""The reason why no resistance is fitted to a table."""


@dataclass(frozen=True)
class RecordFit:
    """The fit of the hysteresis and, for a log, the fits of the heat balance and of the resistance.

    fit                   fit of the hysteresis
    thermal               fit of the heat balance; None for a record that is not a log
    caveats               reasons to distrust the fits
    axes                  labels of input and output
    resistance            fit of the resistance; None if the resistance cannot measure the displacement
    without_resistance    reason why `resistance` is None
    """

    fit: AnyFit
    thermal: ThermalFit | None
    caveats: tuple[str, ...]
    axes: tuple[str, str]
    resistance: ResistanceFit | None = None
    without_resistance: str = NO_CURRENT

    def wire(self, source: str) -> IdentifiedWire:
        """Return the identified wire; `source` names the record."""
        balance = None if self.thermal is None else self.thermal.balance
        sections_c = recorded_sections(self.fit.path)
        resistance = None if self.resistance is None else self.resistance.resistance
        return IdentifiedWire(self.fit.model, balance, self.caveats, self.fit.metrics, source, sections_c, resistance)


def fit_file(path: Path, columns: tuple[str, str], settings: FitSettings) -> RecordFit:
    """Fit the record in a log, or the two `columns` of a CSV file.

    DataError for another kind of file. ConfigError if `columns` of a log are not `INPUT` and `OUTPUT`.
    """
    if LOG.has_ending(path):
        check_log_columns(path, columns)
        return fit_log(read_log(path), settings)
    if not TABLE.has_ending(path) and os.path.exists(path):  # read_table names a missing file
        raise DataError(
            "neither a log nor a CSV", where=path, cure="give the log (.h5) of `smadrive excite`, or a .csv"
        )
    table = read_table(path)
    check_table_columns(path, columns, table.cells)
    v, y = (table.column(name) for name in columns)
    fit = fit_columns(v, y, columns, settings)
    if "time_s" not in table.cells:
        return fit
    return replace(fit, caveats=(*time_caveats(table.column("time_s"), columns[0], v), *fit.caveats))


def check_table_columns(where: object, columns: tuple[str, str], names: Iterable[str]) -> None:
    """Raise DataError if one of the two `columns` is not among `names`, the columns of a table.

    `where` names the table in the error.
    """
    in_order = sorted(names)
    for option, name in zip(("input", "output"), columns, strict=True):
        if name not in in_order:
            way = f"--{option} (in a script {option}=…)"
            other = f"choose another column with {way}; known are: {', '.join(in_order)}"
            raise DataError(f"no column '{name}'", where=where, cure=suggestion(name, in_order) or other)


def check_log_columns(path: Path, columns: tuple[str, str]) -> None:
    """Raise ConfigError if other columns than those of an excitation are chosen for the log at `path`."""
    for name, fitted in zip(columns, (INPUT, OUTPUT), strict=True):
        if name != fitted:
            cure = (
                f"leave the choice of `{name}` out, or write a CSV with `smadrive report LOG --csv FILE` and give that"
            )
            raise ConfigError("the columns of a log cannot be chosen", where=path, value=name, limit=fitted, cure=cure)


def fit_log(log: Log, settings: FitSettings) -> RecordFit:
    """Fit heat balance, hysteresis and, if possible, resistance to the log of an excitation."""
    wire = identify_wire(excitation_record(log), nominal_balance(log), settings)
    caveats = (*run_caveats(log), *excitation_caveats(log), *wire.hysteresis.caveats)
    axes = "wire temperature / °C", "displacement / mm"
    return RecordFit(wire.hysteresis, wire.thermal, caveats, axes, wire.resistance, wire.without_resistance)


def fit_columns(
    v: NDArray[np.float64],
    y: NDArray[np.float64],
    names: tuple[str, str],
    settings: FitSettings,
) -> RecordFit:
    """Fit the hysteresis of output `y` on input `v`.

    `names` are the columns of `v` and `y`. Values that do not fit the unit in a name (`_c`, `_mm`) give a caveat.
    """
    fit = identify_hysteresis(v, y, settings)
    caveats = swap_caveats(names, v, y) or (*unit_caveats(names[0], v), *unit_caveats(names[1], y))
    return RecordFit(fit, None, (*caveats, *fit.caveats), names)
