"""Tables of samples: CSV files whose columns are read by name as finite numbers.

Columns that are not read as numbers are kept as text, unchanged.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import DataError
from smadrive.files.atomic import replacing
from smadrive.files.kinds import TABLE, check_kind
from smadrive.files.number_text import is_number, parse_number, shortened
from smadrive.files.spelling import NO_TEXT, NO_TEXT_CURE, missing_file_cure, suggestion_or_list

Array = NDArray[np.float64]

OTHER_SEPARATORS = (";", "\t")
"""Separators that spreadsheets write instead of commas, in languages with a decimal comma."""


LARGEST = 1e12
"""Largest absolute value of a number in a table. Samples in usual units are smaller; huge squares would overflow."""

MOST_BYTES = 1 << 29
"""Largest size of a file in bytes: ten days at 20 Hz with three columns. In memory the table is ten times larger."""


@dataclass(frozen=True)
class Table:
    """The cells of a CSV file as text.

    `cells` has the texts of each column, by the name of the column. `lines` has the line number of each row in the
    file.
    """

    path: Path
    cells: dict[str, list[str]] = field(repr=False)
    lines: list[int] = field(repr=False)

    def column(self, name: str) -> Array:
        """Return the column `name` as float64.

        DataError when the column is missing, or when a cell is not a finite number or exceeds `LARGEST`. For a cell,
        the error names the line.
        """
        if name not in self.cells:
            cure = _other_unit(name, self.cells) or suggestion_or_list(name, self.cells)
            raise DataError(f"no column '{name}'", where=self.path, cure=cure)
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
            raise DataError(f"{shortened(cell)} is not a finite number", where=where, cure="correct or remove the line")
        if abs(value) > LARGEST:
            raise DataError(
                "too large a number", where=where, value=cell, limit=LARGEST, cure="correct it, or use another unit"
            )
        return value


def _other_unit(name: str, names: Iterable[str]) -> str:
    """Return the cure if one of the `names` is `name` with another unit or none, as time_ms; otherwise ""."""
    quantity, _, unit = name.rpartition("_")
    other = next((one for one in names if quantity in (one, one.rpartition("_")[0])), None) if quantity else None
    return "" if other is None else f"convert the column '{other}' to {unit}, and rename it to '{name}'"


def read_table(path: Path) -> Table:
    """Read the CSV file at `path`.

    DataError when the file is missing, unreadable, too large, without samples or of another kind. DataError also when
    the separator is not a comma, when the header holds numbers, when a line and the header differ in their number of
    cells, or when two columns have the same name.
    """
    check_kind(path, TABLE)
    rows = _rows(path)
    if len(rows) < 2:
        raise DataError("no samples", where=path, cure="write a header line and at least one line of numbers")
    header = [name.strip() for name in rows[0][1]]
    _check_separator(path, header)
    _check_header(path, header)
    for line, row in rows[1:]:
        _check_length(path, line, row, header)
    columns = [(name, [row[n] for _, row in rows[1:]]) for n, name in enumerate(header)]
    named = [(name, cells) for name, cells in columns if name or any(cells)]  # spreadsheets write empty columns
    _check_names(path, [name for name, _ in named])
    return Table(path, dict(named), [line for line, _ in rows[1:]])


def _check_separator(path: Path, header: Sequence[str]) -> None:
    separator = next((sign for sign in OTHER_SEPARATORS if sign in header[0]), None)
    if len(header) == 1 and separator is not None:
        raise DataError(
            f"cells are separated by {separator!r}", where=path, cure="separate them by commas, and use decimal points"
        )


def _check_header(path: Path, header: Sequence[str]) -> None:
    if all(is_number(name) for name in header):
        cure = "write the names of the columns into the first line, for example time_s,displacement_mm"
        raise DataError("the first line holds numbers, no names", where=path, value=",".join(header)[:60], cure=cure)


def _check_length(path: Path, line: int, row: Sequence[str], header: Sequence[str]) -> None:
    if len(row) != len(header):
        raise DataError(
            "the line and the header differ in their number of cells",
            where=f"{path}, line {line}",
            value=f"line: {len(row)}, header: {len(header)}",
            cure="write decimal points, not commas" if len(row) == 2 * len(header) else "repair the line",
        )


def _check_names(path: Path, names: Sequence[str]) -> None:
    twice = [name for name, times in Counter(names).items() if times > 1]
    if twice:
        raise DataError(f"two columns are named {shortened(twice[0])}", where=path, cure="rename or remove one of them")


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the line number and the cells of each line that is not empty."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DataError(
                "too large a table", where=path, value=f"{path.stat().st_size} bytes", limit=MOST_BYTES, cure="split it"
            )
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            return [(reader.line_num, row) for row in reader if row]
    except FileNotFoundError:
        raise DataError("no such file", where=path, cure=missing_file_cure(path)) from None
    except UnicodeDecodeError:
        raise DataError(NO_TEXT, where=path, cure=NO_TEXT_CURE) from None
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"cannot be read as CSV: {error}", where=path) from None


def replaced_caveats(table: Table, computed: str, option: str) -> tuple[str, ...]:
    """Return a caveat if a `computed` column replaces a column of `table`; `option` gives it another name."""
    if computed not in table.cells:
        return ()
    return (f"the computed column '{computed}' replaces that of {table.path}: choose another name with {option}",)


def write_table(path: Path, carried: Mapping[str, list[str]], added: Mapping[str, Array]) -> None:
    """Write the `carried` columns unchanged and the `added` columns as numbers to `path`.

    An added column replaces a carried column of the same name. DataError when the file cannot be written.
    """
    columns = {name: cells for name, cells in carried.items() if name not in added}
    columns |= {name: [repr(float(value)) for value in values] for name, values in added.items()}
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
