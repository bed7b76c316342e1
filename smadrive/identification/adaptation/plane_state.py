"""The state of an adapted Preisach plane, and its derivatives with respect to the moves of its thresholds.

The masses of the plane do not change. Its up-thresholds α and its down-thresholds β move like the branches of the wire:

    α' = μ₊ + d₊ + (α - μ₊) exp(s₊)        β' = μ₋ + d₋ + (β - μ₋) exp(s₋)        θ = (d₊, s₊, d₋, s₋)

μ₊ and μ₋ are the places of the heating and of the cooling branch, d₊ and d₋ the shifts of the thresholds, s₊ and s₋ the
logarithms of their stretches. E is the Everett function before the move. After the move it is E'(a, b) = E(α(a), β(b)):
α(a) and β(b) are the thresholds that the move brings to a and b. The state follows from the turning points alone, for
every θ:

    p = E'(v_1, v_0) - E'(v_1, v_2) + E'(v_3, v_2) - ...        v_0, v_1, ... the turning points and the present input
"""

from __future__ import annotations

from itertools import pairwise
from math import exp

import numpy as np

from smadrive.hysteresis import PreisachPlane, TSFuzzyPreisach
from smadrive.hysteresis.turning_points import Turns, is_rising, pieces, reversed_at
from smadrive.identification.reshape import moved_plane, shape_of
from smadrive.numerics.arrays import FloatArray

UNMOVED = np.zeros(4)
"""θ of a plane whose thresholds have not moved."""


class PlaneState:
    """The turning points of the input of `model`, and the state of its plane for any move θ of the thresholds."""

    def __init__(self, model: TSFuzzyPreisach) -> None:
        self._plane = model.plane
        self._range = model.input_range
        shape = shape_of(model)
        self._mu = shape.mu_heating, shape.mu_cooling
        self._turns: Turns = model.input_range[:1]
        self._v = model.input_range[0]

    def start(self, turns: Turns, v: float) -> None:
        """Begin at the input v, after the turning points `turns`."""
        self._turns, self._v = turns, self._inside(v)

    def move(self, v: float) -> None:
        """Move the input to v."""
        v = self._inside(v)
        if v == self._v:
            return
        if (v > self._v) != is_rising(self._turns):
            self._turns = reversed_at(self._turns, self._v)
        _, self._turns = pieces(self._turns, v)
        self._v = v

    def _inside(self, v: float) -> float:
        return min(max(v, self._range[0]), self._range[1])

    def state(self, moves: FloatArray) -> tuple[float, FloatArray]:
        """Return p, and its derivatives with respect to the moves θ of the thresholds, shape (4,)."""
        up_shift, up_spread, down_shift, down_spread = moves.tolist()
        up_scale, down_scale = exp(-up_spread), exp(-down_spread)
        up_mu, down_mu = self._mu
        p, slopes = 0.0, np.zeros(4)
        for number, (before, after) in enumerate(pairwise((*self._turns, self._v))):
            sign, high, low = (-1.0, before, after) if number % 2 else (1.0, after, before)
            up_way, down_way = (high - up_mu - up_shift) * up_scale, (low - down_mu - down_shift) * down_scale
            up, down = up_mu + up_way, down_mu + down_way
            value, over_up = self._plane.since(up, down, True)
            over_down = -self._plane.since(down, up, False)[1]
            p += sign * value
            slopes -= sign * np.array(
                [over_up * up_scale, over_up * up_way, over_down * down_scale, over_down * down_way]
            )
        return p, slopes

    def plane(self, moves: FloatArray) -> PreisachPlane:
        """Return the plane with moved thresholds. It is a valid plane for every θ; see `moved_plane`."""
        up_shift, up_spread, down_shift, down_spread = moves.tolist()
        up_mu, down_mu = self._mu
        up = up_mu + up_shift + (self._plane.up_thresholds - up_mu) * exp(up_spread)
        down = down_mu + down_shift + (self._plane.down_thresholds - down_mu) * exp(down_spread)
        return moved_plane(up, down, self._plane.mass, self._range)
