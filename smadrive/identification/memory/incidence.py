"""The contribution of each cell of a Preisach plane to the state p of the plane along a path.

    p_k = Σ_cells on_k,cell · mass_cell

p_k is the state at sample k, and on_k,cell is the share of the relays of a cell that are on at sample k. So p is linear
in the masses of the cells. On a section that began at the turning point r, p changes by the Everett function E, which
is bilinear in each cell of the grid (see hysteresis/memory/plane.py). So the path gives one row of weights per sample
for the values of E at the nodes of the grid. Each of these values is a sum of masses, so two cumulative sums turn the
weights of the nodes into the weights of the cells.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from smadrive.hysteresis.turning_points import Turns, is_rising, pieces, reversed_at
from smadrive.numerics.arrays import FloatArray


class PlaneGrid:
    """The grid of a Preisach plane: its thresholds `up` and `down`, and a mask `cells`.

    `cells`, shape (len(up) - 1, len(down) - 1), is True for each cell that may have a mass.
    """

    def __init__(self, up: FloatArray, down: FloatArray, cells: np.ndarray) -> None:
        self.up, self.down, self.cells = up, down, cells
        self._nodes = len(up), len(down)

    def shares_on(self, v: FloatArray, turns: Turns) -> FloatArray:
        """Return the share of the relays of each cell that are on, shape (samples, cells with a mass).

        `v` (samples,) is the path, and `turns` are the turning points before the path.
        """
        weights = self._state_weights(float(v[0]), turns)
        rows = np.empty((len(v), np.count_nonzero(self.cells)))
        rows[0] = self._of_cells(weights)
        for sample, (start, end) in enumerate(pairwise(v.tolist()), start=1):
            if end != start:
                upward = end > start
                if upward != is_rising(turns):
                    turns = reversed_at(turns, start)
                parts, turns = pieces(turns, end)
                begin = start
                for turn, reached in parts:
                    self._add(weights, turn, begin, -1.0, upward)
                    self._add(weights, turn, reached, 1.0, upward)
                    begin = reached
            rows[sample] = self._of_cells(weights)
        return rows

    def _state_weights(self, v: float, turns: Turns) -> FloatArray:
        """Return the weight of each node value of E in the state p at the input v, after the turning points `turns`."""
        weights = np.zeros(self._nodes[0] * self._nodes[1])
        for count, (turn, end) in enumerate(zip(turns, (*turns[1:], v), strict=True), start=1):
            self._add(weights, turn, end, 1.0, count % 2 == 1)
        return weights

    def _add(self, weights: FloatArray, turn: float, v: float, sign: float, rising: bool) -> None:
        """Add to `weights` the node weights of sign · E(v, turn) if `rising`, otherwise of -sign · E(turn, v)."""
        i, s = _place(self.up, v if rising else turn)
        j, t = _place(self.down, turn if rising else v)
        corner = i * self._nodes[1] + j
        sign = sign if rising else -sign
        weights[corner] += sign * (1 - s) * (1 - t)
        weights[corner + 1] += sign * (1 - s) * t
        weights[corner + self._nodes[1]] += sign * s * (1 - t)
        weights[corner + self._nodes[1] + 1] += sign * s * t

    def _of_cells(self, weights: FloatArray) -> FloatArray:
        """Return the weights of the cells with a mass, computed from the weights of the nodes.

        The value of E at the node (i, j) is the sum of the masses of the cells (k, l) with k < i and l ≥ j.
        """
        nodes = weights.reshape(self._nodes)
        above = np.cumsum(nodes[::-1], axis=0)[-2::-1]  # Σ over i > k
        both = np.cumsum(above, axis=1)[:, :-1]  # Σ over j ≤ l
        return np.asarray(both[self.cells])


def _place(thresholds: FloatArray, v: float) -> tuple[int, float]:
    last = len(thresholds) - 2
    cell = min(max(int(np.searchsorted(thresholds, v, side="right")) - 1, 0), last)
    place = (v - thresholds[cell]) / (thresholds[cell + 1] - thresholds[cell])
    return cell, min(max(float(place), 0.0), 1.0)
