"""The rules of a Preisach plane: IF-THEN sentences with the last turning point as a third premise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from smadrive.numerics.arrays import FloatArray


class MemoryRule(NamedTuple):
    """One rule of a Preisach plane for its state p: IF three premises hold THEN dp = b dv.

    The premises: the input v is from `lower` to `upper`, v rises (`direction` +1) or falls (-1), and the last turning
    point of v is about `turn`. b is in 1/(unit of v).
    """

    lower: float
    upper: float
    direction: int
    turn: float
    b: float

    def __str__(self) -> str:
        motion = "rises" if self.direction > 0 else "falls"
        where = f"v is from {self.lower:.6g} to {self.upper:.6g} AND v {motion}"
        return f"IF {where} AND the last turning point is about {self.turn:.6g} THEN dp = {self.b:.6g} dv"


def memory_rules(
    direction: int, cells: Sequence[float], turns: Sequence[float], change: FloatArray
) -> Iterator[MemoryRule]:
    """Yield the rules of one direction whose slope b is not 0.

    `cells` are the thresholds that v passes; a cell lies between two of them. `turns` are the thresholds of the other
    axis. `change` is the change of p across each cell after each turning point, shape (len(cells) - 1, len(turns)).
    """
    slopes = change / np.diff(cells)[:, None]
    for cell, place in np.argwhere(slopes > 0).tolist():
        yield MemoryRule(cells[cell], cells[cell + 1], direction, turns[place], float(slopes[cell, place]))
