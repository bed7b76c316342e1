"""Tables that fit the terminal. A table that is too wide wraps its texts; if this is not enough, it becomes a list.

No number is ever cut.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from rich.cells import cell_len
from rich.table import Table

NUMBER = re.compile(r"[-+±<>\[]?\s?\d")
"""The beginning of a cell that is not wrapped."""

LONGEST_WORD = 16
"""Longer words without a digit may be broken; in characters."""

BORDER, PADDING = 1, 2
"""Characters of a column for its border and for the spaces around its texts; the table has one more border."""


def fitted_table(header: Sequence[str], rows: Sequence[Sequence[str]], texts: set[int], width: int) -> Table | None:
    """Return a table that is at most `width` characters wide, or None if a number would have to be wrapped.

    `texts` are the indices of the columns with texts. These columns are aligned to the left, the others to the right.
    """
    columns = list(zip(header, *rows, strict=True))
    widths = _fitted([max(map(cell_len, column)) for column in columns], [*map(_least, columns)], width)
    if widths is None:
        return None
    table = Table(header_style="bold")
    for number, (name, column_width) in enumerate(zip(header, widths, strict=True)):
        is_text = number in texts
        table.add_column(name, justify="left" if is_text else "right", width=column_width, overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


def list_lines(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the table as lines: a row of two columns is one line, a longer row has one line for each cell."""
    title = f"{header[0]}: " if header[0] else ""
    for first, *others in rows:
        if len(others) == 1:
            yield f"{first}: {others[0]}"
            continue
        yield f"{title}{first}" if first else header[0]
        yield from (f"  {name}: {cell}" if name else f"  {cell}" for name, cell in zip(header[1:], others, strict=True))


def _least(column: Sequence[str]) -> int:
    """Return the smallest width of a column: its longest number, or its longest word.

    A word without a digit may be broken, so it counts at most `LONGEST_WORD`.
    """
    name, *cells = column
    numbers = (cell_len(cell) for cell in cells if NUMBER.match(cell))
    words = (word for cell in (name, *cells) for word in cell.split())
    return max(
        *numbers, *(cell_len(word) if _has_digit(word) else min(cell_len(word), LONGEST_WORD) for word in words), 1
    )


def _has_digit(word: str) -> bool:
    return any(map(str.isdigit, word))


def _fitted(natural: list[int], least: list[int], width: int) -> list[int] | None:
    """Return widths of the columns with which the table is at most `width` wide; None if this is impossible.

    The widths begin at `natural`. The widest column is reduced first, and no column becomes narrower than in `least`.
    """
    widths = natural
    excess = sum(widths) + len(widths) * (BORDER + PADDING) + BORDER - width
    for _ in range(excess):
        spare = [wide if wide > low else 0 for wide, low in zip(widths, least, strict=True)]
        if not any(spare):
            return None
        widest = spare.index(max(spare))
        widths = [wide - (number == widest) for number, wide in enumerate(widths)]
    return widths
