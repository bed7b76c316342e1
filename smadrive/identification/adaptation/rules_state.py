"""The state of adapted rules, and its derivatives with respect to their rates.

Each rule has two rates: p ≥ 0 towards x = 1, and q ≥ 0 towards x = 0. The state x follows

    dx/d|v| = p (1 - x) - q x

d|v| is the distance that the input v moves, up or down. p and q are here the means of the rates of all rules for this
direction, weighted with the memberships of v. The sensitivities z = ∂x/∂θ follow from the derivative of this equation.
θ holds the rates, one number per set: p and q of the heating rules, then p and q of the cooling rules.
"""

from __future__ import annotations

from math import exp

import numpy as np

from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.identification.tsfuzzy.sensitivity import LEAST_RATE, laws_of
from smadrive.numerics.arrays import FloatArray

LONGEST_STEP = 0.25
"""The largest change of v in one step, in the unit of v. A larger change is made in several steps."""


class RulesState:
    """The state `x` of the rules of `model`, and its sensitivities `z`, shape (4 · sets,)."""

    def __init__(self, model: TSFuzzyDuhem) -> None:
        self._base = model
        self._sets = len(model.sets.centres)
        self.x = 0.0
        self.z = np.zeros(4 * self._sets)

    @property
    def least(self) -> FloatArray:
        """The least rates with which the rules contract, shape (4 · sets,)."""
        lower, upper = self._base.input_range
        least = np.zeros(4 * self._sets)
        least[: self._sets] = least[3 * self._sets :] = LEAST_RATE / (upper - lower)
        return least

    def model(self, rates: FloatArray, scale: float) -> TSFuzzyDuhem:
        """Return the rules with these rates and this scale of the output."""
        base = self._base
        laws = laws_of(*rates.reshape(4, -1))
        return TSFuzzyDuhem.from_laws(base.sets, *laws, scale, base.offset, base.input_range)

    def move(self, rates: FloatArray, v0: float, v1: float) -> None:
        """Advance state and sensitivities from v0 to v1, in pieces over which the rates count as constant."""
        pieces = max(1, int(np.ceil(abs(v1 - v0) / LONGEST_STEP)))
        step = (v1 - v0) / pieces
        for piece in range(pieces if step else 0):
            self._piece(rates, v0 + (piece + 0.5) * step, step)

    def change(self, rates: FloatArray) -> None:
        """Change the state x for a change `rates` of θ, to first order. x stays within [0, 1]."""
        self.x = min(max(self.x + float(self.z @ rates), 0.0), 1.0)

    def _piece(self, rates: FloatArray, middle: float, step: float) -> None:
        """Advance x and z over one piece of the length |`step|` around the input `middle`.

        x follows the exact solution of dx/d|v| = p (1 - x) - q x. The step of z uses the mean of x over the piece.
        """
        lower, upper = self._base.input_range
        if not lower <= middle <= upper:
            return
        sets, length = self._sets, abs(step)
        weights = self._base.sets.weights(np.array([middle]))[0]
        first = 0 if step > 0 else 2 * sets
        p = float(weights @ rates[first : first + sets])
        q = float(weights @ rates[first + sets : first + 2 * sets])
        before, decay = self.x, exp(-(p + q) * length)
        if p + q > 0:
            self.x = p / (p + q) + (before - p / (p + q)) * decay
        middle_x = 0.5 * (before + self.x)
        self.z *= decay
        self.z[first : first + sets] += (1.0 - middle_x) * length * weights
        self.z[first + sets : first + 2 * sets] -= middle_x * length * weights
