"""A Preisach plane: the austenite fraction of a wire of many grains, each with two transformation temperatures.

    a grain turns to austenite when v rises above α, and back when v falls below β          α > β
    ξ = the share of grains that are austenite          E(a, b) = the share of grains with α ≤ a and β ≥ b

The input v is the wire temperature in °C, corrected for the stress. While v rises from a minimum m, the grains with
α ≤ v and β ≥ m turn to austenite. While v falls from a maximum M, the grains with β ≥ v and α ≤ M turn back. So ξ
follows from the latest reversal, where ξ was ξ_m or ξ_M (Preisach 1935, Everett 1955):

    rising   ξ = ξ_m + E(v, m)          falling   ξ = ξ_M - E(M, v)

When the input passes an earlier reversal, the plane forgets this reversal and all later reversals. So minor loops close
exactly. A Duhem model does not remember reversals, because ξ is its only state.

In this plane (α, β) have a joint Gaussian density on a grid. Grains with α - β below 4 K are left out. Within a cell of
the grid the density is constant, so E is bilinear.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from firmware_sim.config import Transformation
from smadrive.numerics.arrays import FloatArray

CELL_K = 0.25
SPAN = 5.0  # half of the width of the grid, in standard deviations
NARROWEST_K = 4.0  # smallest α - β of a grain


class Reversal(NamedTuple):
    """A reversal of the input: the input v in °C, the austenite fraction `phase`, and the previous reversal."""

    v: float
    phase: float
    previous: Reversal | None


class PreisachState(NamedTuple):
    """The present input `v` in °C, and the present austenite fraction `phase`.

    The input has been rising (`rising`) or falling since `reversal`.
    """

    v: float
    phase: float
    rising: bool
    reversal: Reversal


class Preisach:
    """The Preisach plane of a transformation. Its methods do not change the state that they get."""

    def __init__(self, plane: Transformation) -> None:
        up = _edges(plane.mu_heating_c, plane.sigma_heating_c)
        down = _edges(plane.mu_cooling_c, plane.sigma_cooling_c)
        self._up_c, self._down_c = float(up[0]), float(down[0])
        self._up_cells, self._down_cells = len(up) - 1, len(down) - 1
        self._everett: list[list[float]] = _everett(plane, up, down).tolist()
        self._coldest = Reversal(self._down_c, 0.0, None)

    def start(self, v: float) -> PreisachState:
        """Return the state of a wire whose input was raised from a much lower value to `v`, in °C."""
        return PreisachState(v, self._share(v, self._coldest.v), rising=True, reversal=self._coldest)

    def phase(self, state: PreisachState) -> float:
        """Return the austenite fraction ξ."""
        return state.phase

    def slope(self, state: PreisachState, v: float, rising: bool) -> float:
        """Return the slope of the austenite fraction, in 1/K, for an input that rises or falls from `v`."""
        reversal_v = state.reversal.v if rising == state.rising else state.v
        if rising:
            row, next_row, _, j, t = self._cell(v, reversal_v)
            return ((1 - t) * (next_row[j] - row[j]) + t * (next_row[j + 1] - row[j + 1])) / CELL_K
        row, next_row, s, j, _ = self._cell(reversal_v, v)
        return ((1 - s) * (row[j] - row[j + 1]) + s * (next_row[j] - next_row[j + 1])) / CELL_K

    def moved(self, state: PreisachState, v0: float, v1: float) -> PreisachState:
        """Return the state after the input changed monotonically from `v0` to `v1`, in °C."""
        if v1 == v0:
            return state
        rising = v1 > v0
        last = state.reversal if rising == state.rising else Reversal(state.v, state.phase, state.reversal)
        while last.previous is not None and (v1 >= last.previous.v if rising else v1 <= last.previous.v):
            if last.previous.previous is None:
                return self.start(v1)  # colder than ever before: no reversal is left
            last = last.previous.previous
        change = self._share(v1, last.v) if rising else -self._share(last.v, v1)
        return PreisachState(v1, last.phase + change, rising, last)

    def _share(self, a: float, b: float) -> float:
        """Return E(a, b), the share of grains with α ≤ a and β ≥ b."""
        row, next_row, s, j, t = self._cell(a, b)
        return (1 - s) * ((1 - t) * row[j] + t * row[j + 1]) + s * ((1 - t) * next_row[j] + t * next_row[j + 1])

    def _cell(self, a: float, b: float) -> tuple[list[float], list[float], float, int, float]:
        """Return the place of (a, b) in the grid: (row, next row, s, j, t).

        The two rows of E are the rows before and after `a`; s, from 0 to 1, is the position of `a` between them. j is
        the column before `b`, and t, from 0 to 1, the position of `b` between the columns j and j + 1.
        """
        s = min(max((a - self._up_c) / CELL_K, 0.0), self._up_cells - 1e-9)
        t = min(max((b - self._down_c) / CELL_K, 0.0), self._down_cells - 1e-9)
        i, j = int(s), int(t)
        return self._everett[i], self._everett[i + 1], s - i, j, t - j


def _edges(mu_c: float, sigma_c: float) -> FloatArray:
    cells = int(np.ceil(2 * SPAN * sigma_c / CELL_K)) + 2  # the outermost cell on either side stays empty
    return np.asarray(mu_c + CELL_K * (np.arange(cells + 1) - cells / 2))


def _everett(plane: Transformation, up: FloatArray, down: FloatArray) -> FloatArray:
    """Return E at the corners of the cells, shape (len(up), len(down))."""
    x = ((up[1:] + up[:-1]) / 2 - plane.mu_heating_c)[:, None] / plane.sigma_heating_c
    y = ((down[1:] + down[:-1]) / 2 - plane.mu_cooling_c)[None, :] / plane.sigma_cooling_c
    r = plane.correlation or 0.0
    grains = np.exp(-(x**2 - 2 * r * x * y + y**2) / (2 * (1 - r**2)))
    grains[up[:-1, None] - down[None, 1:] < NARROWEST_K] = 0.0
    grains[[0, -1], :] = 0.0
    grains[:, [0, -1]] = 0.0
    everett = np.zeros((len(up), len(down)))
    everett[1:, :-1] = np.cumsum(np.cumsum(grains[:, ::-1], axis=1)[:, ::-1], axis=0)
    return np.asarray(everett / everett[-1, 0])
