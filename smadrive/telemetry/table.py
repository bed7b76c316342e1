"""Tables of samples: CSV files whose columns are chosen by name, every cell of which must be a finite number.

Columns that nobody asked for are carried along as text, untouched.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError
from smadrive.filekind import TABLE, check_kind
from smadrive.nearest import nearest
from smadrive.outfile import replacing

Array = NDArray[np.float64]

OTHER_SEPARATORS = (";", "\t")
"""What spreadsheets write where the comma is the decimal sign."""


@dataclass(frozen=True)
class Table:
    """The cells of a CSV file as text, by column."""

    path: Path
    cells: dict[str, list[str]] = field(repr=False)

    def column(self, name: str) -> Array:
        """The column as float64. DataError names the file, the row and the cell that is no finite number."""
        if name not in self.cells:
            raise DataError(f"{self.path}: no column '{name}'" + nearest(name, self.cells))
        values = np.empty(len(self.cells[name]))
        for row, cell in enumerate(self.cells[name]):
            values[row] = self._number(name, row, cell)
        return values

    def _number(self, name: str, row: int, cell: str) -> float:
        try:
            value = float(cell)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            where = f"{self.path}, line {row + 2}, column '{name}'"
            raise DataError(f"{where}: '{cell}' is not a finite number: correct or remove the line")
        return value


def read_table(path: Path) -> Table:
    """The CSV file at `path`. DataError when it is missing, empty, without header, ragged, or separated otherwise."""
    check_kind(path, TABLE)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file, strict=True))
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read as CSV ({error})") from None
    rows = [row for row in rows if row]
    if len(rows) < 2:
        raise DataError(f"{path}: no samples: a header line and at least one line of numbers are needed")
    header = [name.strip() for name in rows[0]]
    separator = next((known for known in OTHER_SEPARATORS if known in header[0]), None)
    if len(header) == 1 and separator is not None:
        raise DataError(f"{path}: separated by {separator!r}: write it with commas between cells, and decimal points")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise DataError(f"{path}, line {number}: {len(row)} cells, the header has {len(header)}: repair the line")
    return Table(path, {name: [row[n] for row in rows[1:]] for n, name in enumerate(header)})


def write_table(path: Path, carried: Mapping[str, list[str]], added: Mapping[str, Array]) -> None:
    """Write the carried columns as they were and the added ones as numbers, completely or not at all (DataError)."""
    columns = {name: cells for name, cells in carried.items() if name not in added}
    columns |= {name: [repr(float(value)) for value in values] for name, values in added.items()}
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
