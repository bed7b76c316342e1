"""The exact branch engine: it computes the state of Duhem and T-S fuzzy Duhem models from tables.

While the input v rises or falls, the state w follows a linear ODE dw/dv = a(v) w + b(v). With Λ(v) = ∫a dv and any
particular solution P(v) of the ODE, the exact solution for any distance v1 - v0 is

    w(v1) = P(v1) + (w(v0) - P(v0)) exp(Λ(v1) - Λ(v0))

This needs neither an ODE solver nor a step size. Λ and P of both branches are tabulated once, as cubic Hermite pieces
on one grid. The tables contain the derivatives a of Λ and a P + b of P, so the error is of fourth order. One array
expression gives all states of a monotone section of the input path. A single step needs a few multiplications and one
exp. Outside the grid the state is constant, because the input is clamped to [lower, upper].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import exp, inf

import numpy as np

from smadrive.numerics.arrays import FloatArray

_CHUNK = 8192  # samples evaluated at once: the working set stays in the cache
_Row = tuple[float, float, float, float, float, float, float, float, float]
_Bin = tuple[float, _Row, _Row]  # position of the extra node (inf without one), rows below and beyond this node


@dataclass(frozen=True, slots=True)
class Branch:
    """The law dw/dv = a(v) w + b(v) of one direction at the nodes of a grid; all fields are (nodes,).

    exponent       Λ, the integral of a over v
    rate           a, the derivative of Λ
    target         P, a particular solution w(v) of the law
    target_slope   a P + b, the derivative of P
    """

    exponent: FloatArray
    rate: FloatArray
    target: FloatArray
    target_slope: FloatArray

    def pieces(self, nodes: FloatArray) -> FloatArray:
        """Return the coefficients of the cubic polynomials of each cell, in v - nodes[cell], shape (8, cells).

        The first four rows belong to `target`, from the constant to the cubic term; the last four belong to `exponent`.
        """
        width = np.diff(nodes)
        return np.vstack([_hermite(width, self.target, self.target_slope), _hermite(width, self.exponent, self.rate)])


def _hermite(width: FloatArray, value: FloatArray, slope: FloatArray) -> FloatArray:
    secant = np.diff(value) / width
    left, right = slope[:-1], slope[1:]
    return np.vstack(
        [value[:-1], left, (3 * secant - 2 * left - right) / width, (left + right - 2 * secant) / width**2]
    )


class BranchEngine:
    """Computes states exactly, from the tables of the heating and the cooling branch.

    `nodes` contains the ends of `bins` uniform cells over [lower, upper]. A cell may contain one more node, at which a
    or b of the law dw/dv = a w + b has a kink.
    """

    def __init__(self, nodes: FloatArray, bins: int, heating: Branch, cooling: Branch) -> None:
        self.nodes, self.heating, self.cooling = nodes, heating, cooling
        self.lower, self.upper = float(nodes[0]), float(nodes[-1])
        self._cells = len(nodes) - 1
        self._last_bin = bins - 1
        self._bins_per_unit = bins / (self.upper - self.lower)
        self._coefficients = np.hstack([cooling.pieces(nodes), heating.pieces(nodes)])
        starts = self.lower + np.arange(bins) / self._bins_per_unit
        self._first = (
            np.minimum(np.searchsorted(nodes, starts + 1e-6 / self._bins_per_unit, side="right"), self._cells) - 1
        )
        inside = nodes[self._first + 1] < starts + (1 - 1e-6) / self._bins_per_unit
        self._split = np.where(inside, nodes[self._first + 1], inf)
        self._has_splits = bool(inside.any())

    def evaluate(self, v: FloatArray, rising: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Return the solution P and the exponent Λ = ∫a dv at the inputs `v` in [lower, upper], both (samples,).

        `rising` (samples,) is True where the heating branch is used, False where the cooling branch is used.
        """
        target, exponent = np.empty_like(v), np.empty_like(v)
        for start in range(0, len(v), _CHUNK):
            part = slice(start, start + _CHUNK)
            self._evaluate_chunk(v[part], rising[part], target[part], exponent[part])
        return target, exponent

    def _evaluate_chunk(self, v: FloatArray, rising: np.ndarray, target: FloatArray, exponent: FloatArray) -> None:
        t = v - self.lower
        t *= self._bins_per_unit
        cell = t.astype(np.intp)
        np.minimum(cell, self._last_bin, out=cell)
        if self._has_splits:
            beyond = v >= self._split.take(cell)
            cell = self._first.take(cell)
            cell += beyond
        np.subtract(v, self.nodes.take(cell, out=t, mode="clip"), out=t)
        cell += self._cells * rising
        coefficient = np.empty_like(t)
        for first, value in ((0, target), (4, exponent)):
            self._coefficients[first + 3].take(cell, out=value, mode="clip")
            for row in (first + 2, first + 1, first):
                np.multiply(value, t, out=value)
                np.add(value, self._coefficients[row].take(cell, out=coefficient, mode="clip"), out=value)

    def trajectory(self, v: FloatArray, w_start: float, out: FloatArray | None = None) -> FloatArray:
        """Return the state w at every sample of the input path `v` (samples,).

        The state at the first sample is `w_start`. If an array `out` is given, the result is written to `out`.
        """
        states = np.empty_like(v) if out is None else out
        states[0] = w_start
        if len(v) == 1:
            return states
        path = v if self.lower <= v.min() and v.max() <= self.upper else np.clip(v, self.lower, self.upper)
        rising = path[1:] > path[:-1]
        starts = np.concatenate([[0], np.flatnonzero(rising[1:] != rising[:-1]) + 1])
        ends = np.concatenate([starts[1:], [len(path) - 1]])
        start_target, start_exponent = self.evaluate(path[starts], rising[starts])
        end_target, end_exponent = self.evaluate(path[ends], rising[starts])
        excess = _chain(w_start, start_target, end_target, np.exp(end_exponent - start_exponent))
        lengths, exponent = ends - starts, np.empty(min(_CHUNK, len(rising)))
        bounds = [*range(0, len(rising), _CHUNK), len(rising)]
        run = np.searchsorted(ends, bounds).tolist()  # section of the step that ends at each bound
        for (begin, end), (before, last) in zip(pairwise(bounds), pairwise(run), strict=True):
            runs = slice(before + (begin == ends[before]), last + 1)
            inside = lengths[runs].copy()
            inside[0] = ends[runs.start] - begin
            inside[-1] -= ends[last] - end
            decay, target = exponent[: end - begin], states[begin + 1 : end + 1]
            self._evaluate_chunk(path[begin + 1 : end + 1], rising[begin:end], target, decay)
            decay -= np.repeat(start_exponent[runs], inside)
            np.exp(decay, out=decay)
            decay *= np.repeat(excess[runs], inside)
            target += decay
        return states

    @cached_property
    def _scalar(self) -> tuple[list[_Bin], list[_Bin]]:
        """The table rows of each uniform cell as plain floats, for single steps: (cooling, heating).

        The upper end of the range has an additional entry, a copy of the entry of the last cell.
        """
        table = np.vstack([np.tile(self.nodes[:-1], 2), self._coefficients]).T.tolist()
        rows: list[_Row] = [tuple(row) for row in table]
        first, split = self._first.tolist(), self._split.tolist()
        cooling, heating = (
            [
                (beyond, rows[cells + cell], rows[cells + cell + (beyond < inf)])
                for cell, beyond in zip([*first, first[-1]], [*split, split[-1]], strict=True)
            ]
            for cells in (0, self._cells)
        )
        return cooling, heating

    def row(self, v: float, rising: bool) -> _Row:
        """Return the table row of one input: the node, 4 coefficients of `Branch.target`, 4 of `Branch.exponent`."""
        split, below, beyond = self._scalar[rising][int((v - self.lower) * self._bins_per_unit)]
        return below if v < split else beyond

    def clamp(self, v: float) -> float:
        """Return `v`, clamped to [lower, upper]."""
        if v < self.lower:
            return self.lower
        return self.upper if v > self.upper else v  # noqa: FURB136 (min() costs a call in the hot path)

    def move(self, w: float, v0: float, v1: float) -> float:
        """Return the state at v1. The state at v0 is w, and the input has moved monotonically from v0 to v1."""
        lower, upper = self.lower, self.upper
        if not (lower <= v0 <= upper and lower <= v1 <= upper):
            v0, v1 = self.clamp(v0), self.clamp(v1)
        if v1 == v0:
            return w
        bins, per_unit = self._scalar[v1 > v0], self._bins_per_unit
        split, below, beyond = bins[int((v0 - lower) * per_unit)]
        node, p0, p1, p2, p3, l0, l1, l2, l3 = below if v0 < split else beyond
        t = v0 - node
        excess = w - (((p3 * t + p2) * t + p1) * t + p0)
        exponent = ((l3 * t + l2) * t + l1) * t + l0
        split, below, beyond = bins[int((v1 - lower) * per_unit)]
        node, p0, p1, p2, p3, l0, l1, l2, l3 = below if v1 < split else beyond
        t = v1 - node
        return ((p3 * t + p2) * t + p1) * t + p0 + excess * exp(((l3 * t + l2) * t + l1) * t + l0 - exponent)

    def section(self, w: float, v: float, rising: bool) -> Callable[[float], tuple[float, float]]:
        """Return the function that gives the state and the slope dw/dv at any input in [lower, upper].

        w is the state at v, and the input moves monotonically from v, upward if `rising`.
        """
        v = self.clamp(v)
        node, p0, p1, p2, p3, l0, l1, l2, l3 = self.row(v, rising)
        t = v - node
        excess = w - (((p3 * t + p2) * t + p1) * t + p0)
        exponent = ((l3 * t + l2) * t + l1) * t + l0

        def at(v1: float) -> tuple[float, float]:
            node, p0, p1, p2, p3, l0, l1, l2, l3 = self.row(v1, rising)
            t = v1 - node
            decayed = excess * exp(((l3 * t + l2) * t + l1) * t + l0 - exponent)
            slope = (3 * p3 * t + 2 * p2) * t + p1 + decayed * ((3 * l3 * t + 2 * l2) * t + l1)
            return ((p3 * t + p2) * t + p1) * t + p0 + decayed, slope

        return at

    def slope(self, w: float, v: float, rising: bool) -> float:
        """Return the slope dw/dv at the state w and the input v; it is zero outside the grid."""
        if not self.lower <= v <= self.upper:
            return 0.0
        node, p0, p1, p2, p3, _, l1, l2, l3 = self.row(v, rising)
        t = v - node
        target = ((p3 * t + p2) * t + p1) * t + p0
        return (3 * p3 * t + 2 * p2) * t + p1 + ((3 * l3 * t + 2 * l2) * t + l1) * (w - target)

    def local_law(self, v: float, *, rising: bool) -> tuple[float, float]:
        """Return a and b of the law dw/dv = a w + b at the input v; both are zero outside the grid."""
        if not self.lower <= v <= self.upper:
            return 0.0, 0.0
        node, p0, p1, p2, p3, _, l1, l2, l3 = self.row(v, rising)
        t = v - node
        rate = (3 * l3 * t + 2 * l2) * t + l1
        return rate, (3 * p3 * t + 2 * p2) * t + p1 - rate * (((p3 * t + p2) * t + p1) * t + p0)

    def target(self, v: float, *, rising: bool) -> float:
        """Return the state w at the input v on the heating branch if `rising`, otherwise on the cooling branch."""
        v = self.clamp(v)
        node, p0, p1, p2, p3, *_ = self.row(v, rising)
        t = v - node
        return ((p3 * t + p2) * t + p1) * t + p0


def _chain(w_start: float, start_target: FloatArray, end_target: FloatArray, decay: FloatArray) -> FloatArray:
    """Return the excess w - P at the start of each monotone section of a path that starts at `w_start`.

    `start_target` and `end_target` are P at both ends of the sections. `decay` is the factor of the excess over each
    section.
    """
    excess, w = [], w_start
    for p_start, p_end, factor in zip(start_target.tolist(), end_target.tolist(), decay.tolist(), strict=True):
        excess.append(w - p_start)
        w = p_end + (w - p_start) * factor
    return np.array(excess)
