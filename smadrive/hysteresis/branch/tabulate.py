"""Tables of a law dw/dv = a(v) w + b(v) for the branch engine: Λ = ∫a dv and the attracting solution P.

Every cell is integrated by Gauss-Legendre quadrature. Inside a cell, Λ at the quadrature points is the integral of the
polynomial that interpolates a (the collocation matrix). So each cell maps P from its end v0 to its end v1, with Λ0 and
Λ1 the values of Λ at these ends:

    P(v1) = P(v0) exp(Λ1 - Λ0) + ∫ b(s) exp(Λ1 - Λ(s)) ds

This affine map is applied only in the direction in which it contracts: upward on heating, downward on cooling. The
cells are halved until the cubic pieces between the nodes agree with the pieces of the next finer grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.hysteresis.branch.engine import Branch, BranchEngine
from smadrive.numerics.arrays import FloatArray

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_LEGENDRE, _LEGENDRE_WEIGHTS = np.polynomial.legendre.leggauss(5)
POINTS = (_LEGENDRE + 1) / 2
WEIGHTS = _LEGENDRE_WEIGHTS / 2
_POWERS = np.arange(1, 6)
INNER = (POINTS[:, None] ** _POWERS / _POWERS) @ np.linalg.inv(np.vander(POINTS, 5, increasing=True))  # ∫ to each point

_FIRST_BINS, _MOST_BINS = 1024, 1 << 17
_TOLERANCE = 1e-10

Build = Callable[[FloatArray], tuple[Branch, Branch]]


@dataclass(frozen=True, slots=True)
class CellIntegrals:
    """Λ = ∫a dv of one branch, at the nodes (nodes,) and at the quadrature points of the cells (cells, 5)."""

    exponent: FloatArray
    inner_exponent: FloatArray


def quadrature_points(nodes: FloatArray) -> FloatArray:
    """Return the quadrature points of every cell, shape (cells, 5)."""
    return nodes[:-1, None] + np.diff(nodes)[:, None] * POINTS


def integrate_rate(nodes: FloatArray, rate: FloatArray) -> CellIntegrals:
    """Return Λ, the integral of the rate a, which is given at the quadrature points (cells, 5). Λ starts at 0."""
    weighted = rate * np.diff(nodes)[:, None]
    exponent = np.concatenate([[0.0], np.cumsum(weighted @ WEIGHTS)])
    return CellIntegrals(exponent, exponent[:-1, None] + weighted @ INNER.T)


def cell_maps(
    nodes: FloatArray, cells: CellIntegrals, bias: FloatArray, *, rising: bool
) -> tuple[FloatArray, FloatArray]:
    """Return `gain` and `shift` of each cell, both (cells,): when the input crosses the cell, w becomes gain w + shift.

    The law is dw/dv = a w + b. `cells` holds the integrals of a, and `bias` is b at the quadrature points (cells, 5).
    If `rising`, the input crosses each cell upward, otherwise downward.
    """
    end = cells.exponent[1:] if rising else cells.exponent[:-1]
    start = cells.exponent[:-1] if rising else cells.exponent[1:]
    forced = bias * np.exp(end[:, None] - cells.inner_exponent) * np.diff(nodes)[:, None]
    shift = forced @ WEIGHTS
    return np.exp(end - start), shift if rising else -shift


def march(start: ArrayLike, gain: FloatArray, shift: FloatArray, *, rising: bool) -> FloatArray:
    """Return the state w at every node, in ascending order, while the input crosses the whole grid.

    If `rising`, the input starts at the lower end, otherwise at the upper end. The state at this end is `start`. In
    each cell w becomes gain w + shift. All cells together are one bidiagonal linear system. Shapes:

              one solution    several solutions
    start     a number        (columns,)
    gain      (cells,)        (cells,)
    shift     (cells,)        (cells, columns)
    result    (nodes,)        (nodes, columns)
    """
    step = 1 if rising else -1
    entered = np.concatenate([np.reshape(start, (1, *shift.shape[1:])), shift[::step]])
    diagonals = np.ones((2, len(entered)))
    np.negative(gain[::step], out=diagonals[1, :-1])
    values, _ = scipy.linalg.lapack.dtbtrs(diagonals, entered, uplo="L", diag="U")
    return np.asarray(values.reshape(entered.shape)[::step])


def uniform_grid(lower: float, upper: float, bins: int, kinks: FloatArray) -> FloatArray:
    """Return `bins` + 1 uniform nodes from `lower` to `upper` together with the kinks, ascending.

    A kink outside the range, or nearer to a uniform node than 1e-5 of a cell, adds no node.
    """
    nodes = np.linspace(lower, upper, bins + 1)
    place = (kinks - lower) / (upper - lower) * bins
    apart = (np.abs(place - np.round(place)) > 1e-5) & (place > 0) & (place < bins)
    return np.sort(np.concatenate([nodes, kinks[apart]]))


def tabulate(lower: float, upper: float, build: Build, kinks: FloatArray) -> BranchEngine:
    """Return the branch engine on the coarsest grid that agrees with the next finer grid to 1e-10.

    `build` takes nodes, and returns the heating and the cooling branch at these nodes. `kinks` are the inputs at which
    the laws of the model are not smooth. Raises ModelError when even a grid of 131,072 cells is too coarse.
    """
    bins, coarse = _FIRST_BINS, None
    while bins <= _MOST_BINS:
        if _kinks_apart(lower, upper, bins, kinks):
            nodes = uniform_grid(lower, upper, bins, kinks)
            fine = BranchEngine(nodes, bins, *build(nodes))
            if coarse is not None and _disagreement(coarse, fine) < _TOLERANCE:
                return coarse
            coarse = fine
        bins *= 2
    what = f"too steep for its range [{lower:g}, {upper:g}]: a table of {_MOST_BINS} cells is too coarse"
    cure = "narrow the range, widen the narrowest σ or set, or increase the distance of branches that almost touch"
    raise ModelError(what, where="hysteresis model", cure=cure)


def _kinks_apart(lower: float, upper: float, bins: int, kinks: FloatArray) -> bool:
    place = np.floor((kinks - lower) / (upper - lower) * bins)
    return len(np.unique(place)) == len(place)


def _disagreement(coarse: BranchEngine, fine: BranchEngine) -> float:
    """Return the largest error of P and Λ of the coarse grid at the fine nodes; relative for Λ where |Λ| > 1."""
    worst = 0.0
    for rising, branch in ((True, fine.heating), (False, fine.cooling)):
        target, exponent = coarse.evaluate(fine.nodes, np.full(len(fine.nodes), rising))
        scale = np.maximum(1.0, np.abs(branch.exponent))
        worst = max(
            worst,
            float(np.max(np.abs(target - branch.target))),
            float(np.max(np.abs(exponent - branch.exponent) / scale)),
        )
    return worst
