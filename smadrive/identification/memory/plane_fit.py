"""Least-squares fit of the masses of a Preisach plane: no mass is negative, a prior determines cells without samples.

    minimise  Σ_k n_k (y_k - bottom - Σ_cells on_k,cell m_cell)² + λ² Σ_neighbours (m/A - m'/A')² A A'        m ≥ 0

y_k is a mean of n_k samples of the output, and bottom the output with all relays off. on_k,cell is the share of the
relays of a cell that are on, m the mass and A the area of a cell. λ is the weight of the prior. The second sum compares
the densities m/A of two neighbouring cells: cells that no sample determines get the density of their neighbours. The
problem is convex (non-negative least squares). It is reduced once to a triangular system, so that a fit to another
output y on the same path is fast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from smadrive.hysteresis.memory.plane import in_plane
from smadrive.identification.memory.incidence import PlaneGrid
from smadrive.identification.record import Record
from smadrive.numerics.arrays import FloatArray

_OUTERMOST = 5e-4  # share of the travel outside the inner thresholds, at either end
_ITERATIONS = 30  # of the non-negative least squares, for each cell


def grid_of(record: Record, thresholds: int) -> PlaneGrid:
    """Return the grid of a plane that is fitted to `record`, with at most `thresholds` thresholds on each axis.

    The thresholds divide the changes of the output into equal parts: those at rising input for the up-thresholds, those
    at falling input for the down-thresholds. Thresholds that lie too close together are merged.
    """
    up, down = (_quantiles(record, thresholds, rising=rising) for rising in (True, False))
    return PlaneGrid(up, down, in_plane(up, down))


def _quantiles(record: Record, thresholds: int, *, rising: bool) -> FloatArray:
    v, change = record.v, np.diff(record.mean_y)
    chosen = (np.diff(v) > 0) == rising
    middle, travel = 0.5 * (v[1:] + v[:-1])[chosen], np.abs(change)[chosen]
    order = np.argsort(middle)
    passed = np.cumsum(travel[order]) / travel.sum()
    shares = np.linspace(_OUTERMOST, 1 - _OUTERMOST, thresholds - 2)
    inner = np.interp(shares, passed, middle[order])
    least = 1e-3 * (record.input_range[1] - record.input_range[0])
    kept = [inner[0]]
    for threshold in inner[1:]:
        if threshold - kept[-1] > least:
            kept.append(threshold)
    if len(kept) == 1:
        kept.append(kept[0] + least)
    lower, upper = record.input_range
    first, last = 2 * kept[0] - kept[1], 2 * kept[-1] - kept[-2]
    return np.unique(np.clip([first, *kept, last], lower, upper))


@dataclass(frozen=True, slots=True)
class PlaneProblem:
    """The least-squares fit of the masses of a plane for one path, with the triangular factor of its QR decomposition.

    rows         the matrix of the problem, (samples + pairs, cells + 1): first one row per sample, times its weight,
                 then one row per pair of neighbouring cells (the prior); the last column belongs to the bottom
    triangular   the factor R of the QR decomposition of `rows`
    weights      square roots of the number of samples in each mean, (samples,)
    """

    rows: FloatArray
    triangular: FloatArray
    weights: FloatArray

    @classmethod
    def of(cls, shares_on: FloatArray, weights: FloatArray, grid: PlaneGrid, smoothness: float) -> PlaneProblem:
        """Return the problem for a path on which the share `shares_on` (samples, cells) of the relays is on.

        `weights` (samples,) are the square roots of the number of samples in each mean. `smoothness` is the weight of
        the prior, which compares neighbouring cells of `grid`.
        """
        pairs = _neighbours(grid)
        samples, cells = shares_on.shape
        rows = np.zeros((samples + len(pairs), cells + 1))
        np.multiply(shares_on, weights[:, None], out=rows[:samples, :cells])
        rows[:samples, cells] = weights
        np.multiply(pairs, smoothness * np.sqrt(weights @ weights), out=rows[samples:, :cells])
        return cls(rows, _triangular(rows), weights)

    def masses(self, output: FloatArray) -> FloatArray:
        """Return the masses of the cells (cells,), none negative, that explain `output` (samples,) best.

        The bottom, which is the output with all relays off, is 0.
        """
        return _non_negative(self.triangular[:-1, :-1], self._projected(output)[:-1])

    def with_bottom(self, output: FloatArray) -> tuple[float, FloatArray]:
        """Return the bottom and the masses (cells,) that together explain `output` (samples,) best.

        The bottom is the output with all relays off.
        """
        signed = np.column_stack([self.triangular, -self.triangular[:, -1]])
        found = _non_negative(signed, self._projected(output))
        return float(found[-2] - found[-1]), found[:-2]

    def residuals(self, output: FloatArray, masses: FloatArray) -> FloatArray:
        """Return the weighted residuals of `output` (samples,) with these `masses`, then those of the prior.

        The shape is (samples + pairs,); a pair is two neighbouring cells of the plane.
        """
        return self._padded(output) - self.rows[:, :-1] @ masses

    def unexplained(self, changes: FloatArray, active: np.ndarray) -> FloatArray:
        """Return the part of `changes` of the output that no change of the `active` masses can explain.

        `changes` has the shape (samples, unknowns), and the mask `active` has the shape (cells,). The result has the
        shape (samples + pairs, unknowns).
        """
        rows, padded = self.rows[:, :-1][:, active], self._padded(changes)
        factor = _triangular(self.triangular[:-1, :-1][:, active])
        half = scipy.linalg.solve_triangular(factor, rows.T @ padded, trans="T")
        return np.asarray(padded - rows @ scipy.linalg.solve_triangular(factor, half))

    def _projected(self, output: FloatArray) -> FloatArray:
        """Return Qᵀ times the weighted output, (cells + 1,). Q = rows R⁻¹ is never formed."""
        along = self.rows[: len(output)].T @ (output * self.weights)
        return np.asarray(scipy.linalg.solve_triangular(self.triangular, along, trans="T"))

    def _padded(self, output: FloatArray) -> FloatArray:
        padded = np.zeros((len(self.rows), *output.shape[1:]))
        padded[: len(output)] = (output.T * self.weights).T
        return padded


def _triangular(rows: FloatArray) -> FloatArray:
    """Return the factor R of the QR decomposition of `rows`. `rows` can be large, so only one copy is made."""
    copy = np.array(rows, order="F")  # LAPACK works in columns, and would copy again
    return np.asarray(scipy.linalg.qr(copy, overwrite_a=True, mode="raw", check_finite=False)[1])


def _non_negative(columns: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray(scipy.optimize.nnls(columns, right, maxiter=_ITERATIONS * columns.shape[1])[0])


def _neighbours(grid: PlaneGrid) -> FloatArray:
    """Return one row for each pair of neighbouring cells: the difference of their densities, times √(A A')."""
    number = np.full(grid.cells.shape, -1)
    number[grid.cells] = np.arange(grid.cells.sum())
    area = np.outer(np.diff(grid.up), np.diff(grid.down))
    pairs = []
    for one, other in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
        both = grid.cells[one] & grid.cells[other]
        pairs.append(np.column_stack([number[one][both], number[other][both], np.sqrt(area[other] / area[one])[both]]))
    first, second, ratio = np.vstack(pairs).T
    rows, count = np.zeros((len(first), int(grid.cells.sum()))), np.arange(len(first))
    rows[count, first.astype(int)] = ratio
    rows[count, second.astype(int)] = -1 / ratio
    return rows
