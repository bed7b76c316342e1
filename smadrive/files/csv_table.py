"""Tables of samples: CSV files whose columns are chosen by name, every cell of which must be a finite number.

Columns that nobody asked for are carried along as text, untouched.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import TABLE, check_kind
from smadrive.files.number_text import parse_number, shortened
from smadrive.files.spelling import nearest

Array = NDArray[np.float64]

OTHER_SEPARATORS = (";", "\t")
"""What spreadsheets write where the comma is the decimal sign."""


LARGEST = 1e12
"""No sample is larger in any unit of use; the square of 1e300 would overflow."""

MOST_BYTES = 1 << 29
"""Ten days at 20 Hz with three columns; in memory a table takes ten times as much as on the disk."""


@dataclass(frozen=True)
class Table:
    """The cells of a CSV file as text, by column; `lines` tells the line of each row."""

    path: Path
    cells: dict[str, list[str]] = field(repr=False)
    lines: list[int] = field(repr=False)

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
            value = parse_number(cell)
        except ValueError:
            value = np.nan
        where = f"{self.path}, line {self.lines[row]}, column '{name}'"
        if not np.isfinite(value):
            raise DataError(f"{where}: {shortened(cell)} is not a finite number: correct or remove the line")
        if abs(value) > LARGEST:
            raise DataError(f"{where}: {cell} is larger than {LARGEST:g}: correct it, or use another unit")
        return value


def read_table(path: Path) -> Table:
    """The CSV file at `path`.

    DataError when it is missing, too large, empty, without header, ragged, or separated otherwise, and when two columns
    have the same name.
    """
    check_kind(path, TABLE)
    rows = _rows(path)
    if len(rows) < 2:
        raise DataError(f"{path}: no samples: a header line and at least one line of numbers are needed")
    header = [name.strip() for name in rows[0][1]]
    separator = next((known for known in OTHER_SEPARATORS if known in header[0]), None)
    if len(header) == 1 and separator is not None:
        raise DataError(f"{path}: separated by {separator!r}: write it with commas between cells, and decimal points")
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise DataError(f"{path}, line {line}: {len(row)} cells, the header has {len(header)}: repair the line")
    columns = [(name, [row[n] for _, row in rows[1:]]) for n, name in enumerate(header)]
    named = [(name, cells) for name, cells in columns if name or any(cells)]  # spreadsheets leave empty columns behind
    twice = [name for name, times in Counter(name for name, _ in named).items() if times > 1]
    if twice:
        raise DataError(f"{path}: {len(named)} columns, two of them named {shortened(twice[0])}: rename or remove one")
    return Table(path, dict(named), [line for line, _ in rows[1:]])


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """The lines that are not empty, each with its number and its cells."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DataError(f"{path}: {path.stat().st_size} bytes, at most {MOST_BYTES} are read: split the table")
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            return [(reader.line_num, row) for row in reader if row]
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read as CSV ({error})") from None


def write_table(path: Path, carried: Mapping[str, list[str]], added: Mapping[str, Array]) -> None:
    """Write the carried columns as they were and the added ones as numbers, completely or not at all (DataError)."""
    columns = {name: cells for name, cells in carried.items() if name not in added}
    columns |= {name: [repr(float(value)) for value in values] for name, values in added.items()}
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
