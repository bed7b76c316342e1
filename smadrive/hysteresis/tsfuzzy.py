"""The T-S fuzzy Duhem model: the rules are blended into one law per direction, and each step is exact.

    dw/dv = Σ_i μ_i(v) (a_i w + b_i) = a(v) w + b(v)           one (a_i, b_i) per fuzzy set and direction

v is the input, w the state, μ_i the membership of the fuzzy set i. Each rule is a scalar semilinear Duhem model (Oh and
Bernstein, IEEE TAC 50(5):631-645, 2005). `branch/engine.py` computes the exact step from one particular solution per
direction. These solutions are the branches of the closed major loop: a full sweep up and down ends where it began.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from smadrive.errors import ModelError
from smadrive.hysteresis.branch.certify import certify
from smadrive.hysteresis.branch.engine import Branch
from smadrive.hysteresis.branch.model import BranchModel
from smadrive.hysteresis.branch.tabulate import cell_maps, integrate_rate, march, quadrature_points, tabulate
from smadrive.hysteresis.certificate import Certificate
from smadrive.hysteresis.fuzzy import FuzzySets, Rule
from smadrive.hysteresis.model import check_output_map
from smadrive.numerics.arrays import FloatArray

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.duhem import DuhemModel


_PIECE = 2048  # number of nodes and quadrature points that are blended at once

Law = tuple[FloatArray, FloatArray]
"""The consequents a and b of the rules of one direction, both (sets,)."""


class TSFuzzyDuhem(BranchModel):
    """A T-S fuzzy Duhem model with two rules per fuzzy set of v: one for rising input, one for falling input.

    a_heating, b_heating, a_cooling and b_cooling have one number per set, in 1/(unit of v). A rule is dw/dv = a w + b.
    Raises ModelError for another number of values, for values that are not finite, for an impossible scale, offset or
    range, and for sets outside `input_range`. Raises ModelError, too, for rules that increase the distance of two
    states by more than a factor of exp(50) over the range. Weaker rules that do not contract are allowed here:
    certificate() reports them, and load_model refuses them.
    """

    def __init__(
        self,
        sets: FuzzySets,
        *,
        a_heating: ArrayLike,
        b_heating: ArrayLike,
        a_cooling: ArrayLike,
        b_cooling: ArrayLike,
        scale: float = 1.0,
        offset: float = 0.0,
        input_range: tuple[float, float],
    ) -> None:
        lower, upper = check_output_map(scale, offset, input_range)
        outside = [c for c in sets.centres if not lower <= c <= upper]
        if outside:
            cure = "move it or widen the range"
            raise ModelError(
                "outside input_range", where="set centre", value=outside[0], limit=(lower, upper), cure=cure
            )
        self.sets = sets
        self.heating_law = _consequents("heating", len(sets.centres), a_heating, b_heating)
        self.cooling_law = _consequents("cooling", len(sets.centres), a_cooling, b_cooling)
        engine = tabulate(lower, upper, self._branches, sets.kinks)
        super().__init__(engine, scale, offset, (lower, upper))

    @classmethod
    def from_duhem(cls, model: DuhemModel, sets: FuzzySets) -> Self:
        """Return a model whose rules have the a and b of a Duhem model at the centres of the sets.

        The law of the Duhem model is dw/dv = a(v) w + b(v). This is the derivation approach of the paper, Eq. (9).
        """
        centres = np.clip(np.array(sets.centres), model.engine.lower, model.engine.upper)
        heating, cooling = (model.local_laws(centres, rising=rising) for rising in (True, False))
        return cls.from_laws(sets, heating, cooling, model.scale, model.offset, model.input_range)

    @classmethod
    def from_laws(
        cls, sets: FuzzySets, heating: Law, cooling: Law, scale: float, offset: float, input_range: tuple[float, float]
    ) -> Self:
        """Return a model with the consequents (a, b) of the heating rules and of the cooling rules.

        A rule is dw/dv = a w + b. `heating` and `cooling` are pairs (a, b) of arrays with one number per set, in
        1/(unit of v).
        """
        (a_heating, b_heating), (a_cooling, b_cooling) = heating, cooling
        return cls(
            sets,
            a_heating=a_heating,
            b_heating=b_heating,
            a_cooling=a_cooling,
            b_cooling=b_cooling,
            scale=scale,
            offset=offset,
            input_range=input_range,
        )

    @property
    def rules(self) -> tuple[Rule, ...]:
        """All rules, those for rising input first."""
        return tuple(
            Rule(centre, direction, float(a), float(b))
            for direction, law in ((1, self.heating_law), (-1, self.cooling_law))
            for centre, a, b in zip(self.sets.centres, *law, strict=True)
        )

    def rules_text(self) -> str:
        """Return the rules as IF-THEN sentences, one per line."""
        return "\n".join(map(str, self.rules))

    def admissible(self, v: float) -> tuple[float, float]:  # noqa: ARG002
        """Return 0 and 1: at every input each state in [0, 1] is possible."""
        return 0.0, 1.0

    def certificate(self) -> Certificate:
        """Return the certificate. Contraction and boundedness are proven rule by rule."""
        return certify(self.engine, (self.heating_law, self.cooling_law))

    def _branches(self, nodes: FloatArray) -> tuple[Branch, Branch]:
        return MembershipGrid(self.sets, nodes).closed_branches(self.heating_law, self.cooling_law)


class MembershipGrid:
    """The memberships of fuzzy sets at the nodes and at the quadrature points of a grid."""

    def __init__(self, sets: FuzzySets, nodes: FloatArray) -> None:
        self._nodes = nodes
        self._weights = sets.weights(np.concatenate([nodes, quadrature_points(nodes).ravel()]))
        self.at_nodes = self._weights[: len(nodes)]

    def closed_branches(self, heating_law: Law, cooling_law: Law) -> tuple[Branch, Branch]:
        """Return the heating and the cooling branch of the major loop: a full sweep up and down ends where it began.

        `heating_law` and `cooling_law` are pairs (a, b) of arrays with one number per set; a rule is dw/dv = a w + b.
        Raises ModelError for rules that increase the distance of two states by more than a factor of exp(50).
        """
        blended = self._blended(np.array([*heating_law, *cooling_law]))
        at_nodes, inside = np.split(blended, [len(self._nodes)], axis=1)
        maps = []
        for rising, (a, b) in ((True, inside[:2]), (False, inside[2:])):
            cells = integrate_rate(self._nodes, a.reshape(len(self._nodes) - 1, -1))
            bias = b.reshape(len(self._nodes) - 1, -1)
            maps.append((cells, *_contained(*cell_maps(self._nodes, cells, bias, rising=rising))))
        (up, up_gain, up_shift), (down, down_gain, down_shift) = maps
        bottom = _closing_state(up_gain, up_shift, down_gain, down_shift)
        heating = march(bottom, up_gain, up_shift, rising=True)
        cooling = march(float(heating[-1]), down_gain, down_shift, rising=False)
        branches = []
        for cells, target, (rate, bias) in ((up, heating, at_nodes[:2]), (down, cooling, at_nodes[2:])):
            branches.append(Branch(cells.exponent, rate, target, rate * target + bias))
        return branches[0], branches[1]

    def _blended(self, values: FloatArray) -> FloatArray:
        """Return `values` (rows, sets), blended by the memberships: shape (rows, nodes + quadrature points).

        The products are so small that BLAS starts no threads (see blas_threads.py).
        """
        pieces = [self._weights[start : start + _PIECE] for start in range(0, len(self._weights), _PIECE)]
        return np.hstack([values @ piece.T for piece in pieces])


def _closing_state(up_gain: FloatArray, up_shift: FloatArray, down_gain: FloatArray, down_shift: FloatArray) -> float:
    """Return the state w at the lower end of the input range that a full loop leaves unchanged.

    A full loop is heating, then cooling. Return 0 if the loop does not contract.
    """
    fall = float(np.prod(down_gain))
    gain = float(np.prod(up_gain)) * fall
    if not gain < 1:
        return 0.0
    top = _reached_from_zero(up_gain, up_shift)
    return (top * fall + _reached_from_zero(down_gain[::-1], down_shift[::-1])) / (1 - gain)


def _reached_from_zero(gain: FloatArray, shift: FloatArray) -> float:
    """Return the end state of a sweep from w = 0. The cells are in the order of the sweep."""
    later = np.append(np.cumprod(gain[:0:-1])[::-1], 1.0)
    return float(shift @ later)


def _contained(gain: FloatArray, shift: FloatArray) -> tuple[FloatArray, FloatArray]:
    growth = float(np.sum(np.log(np.maximum(gain, 1e-300))))
    if not (np.isfinite(shift).all() and growth < 50):
        cure = "give a ≤ 0 on heating and a ≥ 0 on cooling"
        raise ModelError(
            "the distance of two states grows by more than a factor of exp(50) over the range", where="rules", cure=cure
        )
    return gain, shift


def _consequents(name: str, sets: int, a: ArrayLike, b: ArrayLike) -> tuple[FloatArray, FloatArray]:
    pair = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)  # copies: a caller may change its arrays
    for symbol, values in zip("ab", pair, strict=True):
        if values.shape != (sets,):
            where = f"{name} rules: {symbol}"
            raise ModelError("not one number per set", where=where, value=f"shape {values.shape}, {sets} sets")
        if not np.isfinite(values).all():
            raise ModelError("not finite", where=f"{name} rules: {symbol}", value=values.tolist())
    return pair
