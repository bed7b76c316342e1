"""The likely changes of a wire, as the covariance of the parameters of its model.

A wire in use changes in few ways: a branch shifts, a branch becomes wider or narrower, the stroke changes. Rules and
plane of a model with memory describe the same wire, so they change together. In addition, each rate may change a
little, and the plane may move a little without the rules.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from smadrive.hysteresis import TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.reshape import shape_of
from smadrive.identification.tsfuzzy.sensitivity import rates_of
from smadrive.numerics.arrays import FloatArray

APART = 0.25
"""Likely move of the plane without the rules, as a share of the likely move of a branch."""


@dataclass(frozen=True, slots=True)
class LikelyChanges:
    """Standard deviations of the changes of a wire.

    drift_c    shift of a branch, K
    drift      change of the scale and of the width of a branch, as a share
    free       change of a single rate, as a share of the largest rate among its set and the two neighbouring sets, and
               at least of a tenth of the largest rate of all sets
    """

    drift_c: float = 3.0
    drift: float = 0.05
    free: float = 0.03

    def covariance(self, model: TSFuzzyDuhem | TSFuzzyPreisach) -> FloatArray:
        """Return the covariance of (rates of the rules, moves of the plane, ln scale).

        A model without memory has no moves of the plane.
        """
        rules, moves = (model.local, 4) if isinstance(model, TSFuzzyPreisach) else (model, 0)
        centres, shape = np.array(rules.sets.centres), shape_of(model)
        rates = rates_of(rules).reshape(4, -1)
        covariance = np.zeros((rates.size + moves + 1,) * 2)
        for branch, mu in enumerate((shape.mu_heating, shape.mu_cooling)):
            rows, move = slice(2 * branch, 2 * branch + 2), slice(2 * branch, 2 * branch + 2)
            for way in (-1.0, 1.0):
                for shift_c, stretch in ((way * self.drift_c, 1.0), (0.0, 1.0 + way * self.drift)):
                    moved, planes = rates.copy(), np.zeros(moves)
                    back = mu + (centres - shift_c - mu) / stretch
                    moved[rows] = [np.interp(back, centres, rate) / stretch for rate in rates[rows]]
                    if moves:
                        planes[move] = shift_c, log(stretch)
                    change = np.concatenate([(moved - rates).ravel(), planes, [0.0]])
                    covariance += 0.5 * np.outer(change, change)
        apart = [APART * self.drift_c, APART * self.drift] * (moves // 2)
        return covariance + np.diag(np.concatenate([self._free_rates(rates), apart, [self.drift]]) ** 2)

    def _free_rates(self, rates: FloatArray) -> FloatArray:
        padded = np.pad(rates, ((0, 0), (1, 1)), "edge")
        around = np.maximum.reduce([np.roll(padded, n, axis=1) for n in (-1, 0, 1)])[:, 1:-1]
        return np.asarray(self.free * np.maximum(around, rates.max(axis=1, keepdims=True) / 10.0).ravel())
