"""The Preisach plane: relays with two thresholds, as a table of the Everett function.

A relay with the thresholds (α, β), α ≥ β, switches on when the input v rises above α, and off when v falls below β.
Each cell of a grid of thresholds holds a mass of relays, uniform within the cell. The state p of the plane is the mass
of the relays that are on. On a section that begins at a turning point, p changes by the Everett function E, the mass of
a triangle of the plane:

    E(a, b) = mass of the relays with α ≤ a and β ≥ b          bilinear in a and b within each cell of the grid
    rising from the turning point m    p = p_m + E(v, m)       falling from the turning point M    p = p_M - E(M, v)

p_m and p_M are p at the turning points. So the slope of p is constant within a cell of v, and linear in the turning
point (Preisach 1935, Everett 1955). So the plane consists of rules with the last turning point as a third premise:

    IF v is in a cell of α AND v rises AND the last turning point is about a threshold β THEN dp = b dv, b = ∂E/∂v

A cell lies in the plane only if all its relays have α ≥ β. So E(v, v) = 0. When v returns to a turning point, p returns
to its value at this turning point.
"""

from __future__ import annotations

from bisect import bisect_right
from math import inf, nan, nextafter
from typing import TYPE_CHECKING

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.files.number_text import shortened
from smadrive.hysteresis.memory.rule import MemoryRule, memory_rules
from smadrive.hysteresis.turning_points import Turns
from smadrive.numerics.arrays import FloatArray, float_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MOST_THRESHOLDS = 200
"""The largest number of thresholds on each axis. A wire needs at most 40."""

_ROUNDING, _CLOSE = 1e-9, 1e-12

_Piece = tuple[float, float, float, float, float, float]
"""Turning point, lowest input, first input above the piece, dp/dv, one end, change of p from turning point to end."""

_NO_PIECE: _Piece = (nan, nan, nan, nan, nan, nan)


class PreisachPlane:
    """A Preisach plane: the masses of its relays in the cells between the thresholds.

    `mass` has the shape (up_thresholds - 1, down_thresholds - 1). The masses are not negative, and their sum is 1. The
    thresholds are ascending and have the unit of v. Raises ModelError for other values, and for a mass in a cell with
    an up-threshold below its down-threshold. `table` holds the Everett function at all pairs of thresholds, shape
    (up_thresholds, down_thresholds).
    """

    def __init__(self, up_thresholds: ArrayLike, down_thresholds: ArrayLike, mass: ArrayLike) -> None:
        self.up_thresholds = _thresholds("up_thresholds", up_thresholds)
        self.down_thresholds = _thresholds("down_thresholds", down_thresholds)
        self.mass = _masses(mass, self.up_thresholds, self.down_thresholds)
        table = np.zeros((len(self.up_thresholds), len(self.down_thresholds)))
        table[1:, :-1] = np.cumsum(np.cumsum(self.mass[:, ::-1], axis=1)[:, ::-1], axis=0)
        self.table = table
        self._rows: list[list[float]] = table.tolist()
        self._up: list[float] = self.up_thresholds.tolist()
        self._down: list[float] = self.down_thresholds.tolist()
        self._last_up = len(self._up) - 2
        self._columns: list[list[float]] = (-table.T).tolist()
        self._latest, self._before = [_NO_PIECE, _NO_PIECE], [_NO_PIECE, _NO_PIECE]  # of falling and of rising input
        self._knots: list[float] = np.union1d(self.up_thresholds, self.down_thresholds).tolist()
        self._bounds = self._tabulated_bounds()

    @property
    def rules(self) -> tuple[MemoryRule, ...]:
        """The rules whose slope b is not 0: first those for rising input, then those for falling input."""
        rising = memory_rules(1, self._up, self._down, np.diff(self.table, axis=0))
        return (*rising, *memory_rules(-1, self._down, self._up, -np.diff(self.table, axis=1).T))

    def everett(self, a: float, b: float) -> float:
        """Return the Everett function: the mass of the relays with an up-threshold ≤ a and a down-threshold ≥ b."""
        up, down = self._up, self._down
        if a <= up[0] or b >= down[-1]:
            return 0.0
        i = min(bisect_right(up, a) - 1, self._last_up)
        j = max(bisect_right(down, b) - 1, 0)
        s = min((a - up[i]) / (up[i + 1] - up[i]), 1.0)
        t = max((b - down[j]) / (down[j + 1] - down[j]), 0.0)
        row, above = self._rows[i], self._rows[i + 1]
        low = row[j] + t * (row[j + 1] - row[j])
        return low + s * (above[j] + t * (above[j + 1] - above[j]) - low)

    def everett_values(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """Return the Everett function for arrays a and b of one shape, as an array of this shape.

        A value is the mass of the relays with an up-threshold ≤ a and a down-threshold ≥ b.
        """
        i, s = _place(self.up_thresholds, a)
        j, t = _place(self.down_thresholds, b)
        values, columns = self.table.ravel(), self.table.shape[1]
        corner = i * columns + j
        low = (1 - t) * values.take(corner) + t * values.take(corner + 1)
        high = (1 - t) * values.take(corner + columns) + t * values.take(corner + columns + 1)
        return np.asarray((1 - s) * low + s * high)

    def slope(self, v: float, turn: float, rising: bool) -> float:
        """Return the slope dp/dv of the plane's state p at the input v, upward if `rising`, otherwise downward.

        The section of the input began at the turning point `turn`.
        """
        return self._piece(v, turn, rising)[3]

    def change(self, start: float, end: float, turn: float, rising: bool) -> float:
        """Return the change of p while the input moves from `start` to `end` on the section that began at `turn`.

        The section rises if `rising`, otherwise it falls. The input may also move against this direction.
        """
        piece = self._latest[rising]
        if piece[0] != turn or not piece[1] <= start < piece[2]:
            piece = self._piece(start, turn, rising)
        if piece[1] <= end < piece[2]:
            return piece[3] * (end - start)
        _, _, _, slope, anchor, value = piece
        before = value + slope * (start - anchor)
        _, _, _, slope, anchor, value = self._piece(end, turn, rising)
        return value + slope * (end - anchor) - before

    def since(self, v: float, turn: float, rising: bool) -> tuple[float, float]:
        """Return the change of p from the turning point `turn`, at which the section began, to v, and dp/dv at v."""
        _, _, _, slope, anchor, value = self._piece(v, turn, rising)
        return value + slope * (v - anchor), slope

    def _piece(self, v: float, turn: float, rising: bool) -> _Piece:
        """Return the piece of p that contains v, on the section that began at the turning point `turn`.

        The latest two pieces of each direction are cached: one for the state of the wire, one for the setpoint.
        """
        latest = self._latest[rising]
        if latest[0] == turn and latest[1] <= v < latest[2]:
            return latest
        piece = self._before[rising]
        if piece[0] != turn or not piece[1] <= v < piece[2]:
            piece = self._computed_piece(v, turn, rising)
        self._latest[rising], self._before[rising] = piece, latest
        return piece

    def _computed_piece(self, v: float, turn: float, rising: bool) -> _Piece:
        knots, rows = (self._up, self._rows) if rising else (self._down, self._columns)
        across = self._down if rising else self._up
        last = len(knots) - 1
        cell = min(max(bisect_right(knots, v) - 1, 0), last - 1)
        place = min(max(bisect_right(across, turn) - 1, 0), len(across) - 2)
        share = min(max((turn - across[place]) / (across[place + 1] - across[place]), 0.0), 1.0)
        row, above = rows[cell], rows[cell + 1]
        value = row[place] + share * (row[place + 1] - row[place])
        top = above[place] + share * (above[place + 1] - above[place])
        low, high = knots[cell], knots[cell + 1]
        slope = (top - value) / (high - low)
        if v < low:
            return turn, -inf, low, 0.0, low, value
        if v > high:
            return turn, nextafter(high, inf), inf, 0.0, high, top
        return turn, low, high if cell < last - 1 else nextafter(high, inf), slope, low, value

    def branch(self, v: float, *, rising: bool) -> float:
        """Return the plane's state p at v on the heating branch if `rising`, otherwise on the cooling branch."""
        anchor, heating, heating_slope, cooling, cooling_slope = self._bounds[bisect_right(self._knots, v)]
        return heating + heating_slope * (v - anchor) if rising else cooling + cooling_slope * (v - anchor)

    def clamp(self, p: float, v: float) -> float:
        """Return p, clamped to the states between the branches of the plane at the input v."""
        anchor, heating, heating_slope, cooling, cooling_slope = self._bounds[bisect_right(self._knots, v)]
        low = heating + heating_slope * (v - anchor)
        if p < low:
            return low
        high = cooling + cooling_slope * (v - anchor)
        return high if p > high else p  # noqa: FURB136 (min() costs a call in the hot path)

    def _tabulated_bounds(self) -> list[tuple[float, float, float, float, float]]:
        """Return a row for each interval between neighbouring thresholds of both axes, and for both intervals outside.

        A row holds an input, p and dp/dv of the heating branch at this input, then p and dp/dv of the cooling branch.
        """
        knots = np.array(self._knots)
        heating, cooling = (self.branches(knots, rising=rising) for rising in (True, False))
        slopes = [np.append(np.diff(branch) / np.diff(knots), 0.0).tolist() for branch in (heating, cooling)]
        rows = list(zip(self._knots, heating.tolist(), slopes[0], cooling.tolist(), slopes[1], strict=True))
        return [(self._knots[0], heating.tolist()[0], 0.0, cooling.tolist()[0], 0.0), *rows]

    def history(self, v: float, p: float, ends: tuple[float, float]) -> Turns:
        """Return the turning points of the first-order reversal curve through (v, p). `ends` is the range of v.

        The curve falls from the upper end to one turning point, and rises from there to v.
        """
        lower, upper = ends

        def excess(turn: float) -> float:
            return self.branch(turn, rising=False) + self.everett(v, turn) - p

        if excess(lower) >= -_CLOSE:
            return (lower,)
        if excess(v) <= _CLOSE:
            return lower, upper
        return lower, upper, float(scipy.optimize.brentq(excess, lower, v, xtol=1e-12))

    def branches(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return the state of the plane at the inputs `v`: the heating branch if `rising`, else the cooling branch."""
        if rising:
            return self.everett_values(v, np.full_like(v, self._down[0]))
        return np.asarray(1.0 - self.everett_values(np.full_like(v, self._up[-1]), v))


def _place(thresholds: FloatArray, v: FloatArray) -> tuple[np.ndarray, FloatArray]:
    """Return the cell of each input, and its place in the cell from 0 to 1. Inputs are clamped to the grid."""
    cell = np.clip(np.searchsorted(thresholds, v, side="right") - 1, 0, len(thresholds) - 2)
    place = (v - thresholds.take(cell)) / (thresholds.take(cell + 1) - thresholds.take(cell))
    return cell, np.clip(place, 0.0, 1.0)


def _thresholds(name: str, values: ArrayLike) -> FloatArray:
    thresholds = float_array(name, values)
    where = f"Preisach plane: {name}"
    if thresholds.ndim != 1 or not 2 <= len(thresholds) <= MOST_THRESHOLDS:
        raise ModelError("wrong number of thresholds", where=where, value=thresholds.shape, limit=(2, MOST_THRESHOLDS))
    steps = np.diff(thresholds)
    if not (np.isfinite(steps).all() and (steps > 0).all()):
        value = shortened(thresholds.tolist())
        raise ModelError("must be finite, and each larger than the one before", where=where, value=value)
    return thresholds


def in_plane(up_thresholds: FloatArray, down_thresholds: FloatArray) -> np.ndarray:
    """Return a mask of the cells, True where no relay has an up-threshold below its down-threshold.

    The mask has the shape (up_thresholds - 1, down_thresholds - 1).
    """
    return np.asarray(up_thresholds[:-1, None] >= down_thresholds[None, 1:])


def _masses(values: ArrayLike, up: FloatArray, down: FloatArray) -> FloatArray:
    where, mass = "Preisach plane: mass", float_array("mass", values)
    if mass.shape != (len(up) - 1, len(down) - 1):
        raise ModelError("not one number per cell", where=where, value=mass.shape, limit=(len(up) - 1, len(down) - 1))
    if not np.isfinite(mass).all() or (mass < 0).any():
        raise ModelError("negative or not finite", where=where, value=float(np.nanmin(mass)))
    if abs(float(mass.sum()) - 1) > _ROUNDING:
        raise ModelError("must have the sum 1", where=where, value=float(mass.sum()))
    if mass[~in_plane(up, down)].any():
        raise ModelError("is not 0 in a cell with an up-threshold below its down-threshold", where=where)
    return mass
