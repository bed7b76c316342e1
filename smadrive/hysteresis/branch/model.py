"""Models whose state w follows one law per direction of the input v: dw/dv = a(v) w + b(v).

The slope depends on v, on w and on the direction, and on nothing else. Λ(v) is the integral of a, and P(v) is a
particular solution of the law. The inverse finds the input v1 that takes the wire from w0 at v0 to the state w1:

    P(v1) + (w0 - P(v0)) exp(Λ(v1) - Λ(v0)) = w1

The first guess is the exact solution for constant a and b, v1 = v0 + ln((a w1 + b)/(a w0 + b))/a.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from smadrive.hysteresis.branch.root import find_input, first_guess
from smadrive.hysteresis.model import HysteresisModel, HysteresisState

if TYPE_CHECKING:
    from smadrive.hysteresis.branch.engine import BranchEngine
    from smadrive.numerics.arrays import FloatArray


class BranchModel(HysteresisModel):
    """The base class of DuhemModel and TSFuzzyDuhem.

    A subclass defines `admissible` and `certificate`, and gives the constructor a BranchEngine: the tables of both
    branches, from which states are computed.
    """

    def __init__(self, engine: BranchEngine, scale: float, offset: float, input_range: tuple[float, float]) -> None:
        super().__init__(scale, offset, input_range)
        self.engine = engine

    def branch(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return the state w at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""
        inside = np.clip(np.asarray(v, dtype=np.float64), self.engine.lower, self.engine.upper)
        return self.engine.evaluate(inside, np.full(inside.shape, rising))[0]

    def branch_slope(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return dw/dv at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""
        branch = self.engine.heating if rising else self.engine.cooling
        return np.asarray(np.interp(v, self.engine.nodes, branch.target_slope, left=0.0, right=0.0))

    def slope(self, state: HysteresisState, direction: int) -> float:
        """Return dy/dv at `state`, for an input that rises (direction > 0) or falls."""
        return self.scale * self.engine.slope(state.w, state.v, direction > 0)

    def corrected(self, state: HysteresisState, v: float, y: float) -> HysteresisState:  # noqa: ARG002
        """Return the state with the input v and the output y, or with the possible output that is nearest to y."""
        return self._between(float(v), self._admitted(v, y))

    def _on_branch(self, v: float) -> HysteresisState:
        w = self.engine.target(v, rising=True)
        return HysteresisState(v, self.offset + self.scale * w, w)

    def _between(self, v: float, w: float) -> HysteresisState:
        return HysteresisState(v, self.offset + self.scale * w, w)

    def _moved(self, state: HysteresisState, v: float) -> HysteresisState:
        w = self.engine.move(state.w, state.v, v)
        return HysteresisState(v, self.offset + self.scale * w, w)

    def _trajectory(self, v: FloatArray, start: HysteresisState, out: FloatArray) -> None:
        self.engine.trajectory(v, start.w, out)

    def reach(self, state: HysteresisState, w: float) -> HysteresisState:
        """Return the state at which a wire that moves from `state` reaches the normalised state w.

        The input moves in one direction only. If no input of the range leads to w, the result is the state at the end
        of the range.
        """
        rising = w > state.w
        section = self.engine.section(state.w, state.v, rising)
        near, far = self.engine.clamp(state.v), self.engine.upper if rising else self.engine.lower
        if near == far:
            return self._between(near, state.w)
        a, b = self.engine.local_law(near, rising=rising)
        guess = first_guess(a, a * state.w + b, w - state.w, near, far)
        return self._between(*find_input(section, w, near, far, guess, rising=rising))
