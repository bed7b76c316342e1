"""The prior of the rules: the local laws of a Duhem fit. It determines the rules where the record has no samples.

A tie pulls each rate of a rule towards the prior with the weight of about one sample. So the samples decide wherever
the record has samples.
"""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from smadrive.hysteresis.duhem import DuhemModel
from smadrive.identification.quality.metrics import Fit
from smadrive.identification.record import Record
from smadrive.numerics.arrays import FloatArray

_LARGEST_PRIOR = 200.0  # largest rate per input span
_CELLS = 400
_STRAY, _STRAY_LEAST = 0.3, 0.5  # rates may differ from the Duhem fit by a share of p + q plus a rate per input span
_SLOPE_TIE = 3e-4  # tie of slopes to the right sign on a record without noise, in output spans
_SATURATED = 0.02  # the tie of slopes tightens with saturation until 4 w (1 - w) is about this value
_TIE_MISFIT = 0.2  # this share of the misfit of the Duhem fit counts like noise
_TIE_FLOOR = 2e-6  # tie to the Duhem fit for a record without noise, in output spans


class Prior:
    """The rates of a Duhem fit, tabulated over the input v. The rules stay near these rates where samples are missing.

    There are four rates, all in 1/(input span): p (towards w = 1) and q (towards w = 0) of heating, then of cooling.
    `weight` is the weight of the tie between the rules and these rates, in output spans: the noise of the record, or a
    fifth of the RMS error of the Duhem fit if that is larger.
    """

    def __init__(self, fit: Fit[DuhemModel], record: Record) -> None:
        lower, upper = record.input_range
        model = fit.model
        self.model = model
        self.grid = np.linspace(lower, upper, _CELLS + 1)
        inside = np.clip(self.grid, model.engine.lower, model.engine.upper)
        rates = []
        for rising in (True, False):
            a, b = model.local_laws(inside, rising=rising)
            total = np.minimum(np.abs(a) * (upper - lower), _LARGEST_PRIOR)
            share = np.clip(np.divide(b, -a, out=np.zeros_like(b), where=a != 0), 0.0, 1.0)  # far from the loop a is 0
            rates += [total * share, total * (1 - share)]
        self.rates = np.array(rates)
        self._slopes = np.gradient(self.rates, self.grid, axis=1)
        self.weight = max(record.noise, _TIE_MISFIT * fit.rms_percent / 100, _TIE_FLOOR)

    def tied(self, factor: float) -> Self:
        """Return a copy with `weight` multiplied by `factor`."""
        closer = copy(self)
        closer.weight = factor * self.weight
        return closer

    def at(self, centres: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the four rates at the centres of the sets, and their derivatives with respect to v, both (4, sets)."""
        return _interpolate(centres, self.grid, self.rates), _interpolate(centres, self.grid, self._slopes)

    def reach(self, centres: FloatArray) -> FloatArray:
        """Return the unit of the tie, in 1/(input span), one for each of the four rates at each centre, (4 · sets,).

        A rule's rate that differs from the prior by this unit adds a residual of `weight`, as one sample with an error
        of `weight` output spans does.
        """
        pairs = _interpolate(centres, self.grid, self.rates).reshape(2, 2, -1)
        return np.ravel(np.repeat(_STRAY * pairs.sum(axis=1) + _STRAY_LEAST, 2, axis=0))

    def slope_tie(self, v: FloatArray) -> FloatArray:
        """Return the weights with which the fit penalises slopes of the wrong sign at the inputs v, shape (2, len(v)).

        The first row belongs to heating, the second row to cooling. RuleProblem multiplies these weights by `monotony`
        and by the root of the number of samples. The weights rise near saturation: the state hardly moves there, so a
        slope of the wrong sign hardly changes the misfit, but it can prevent an inverse.
        """
        pairs = _interpolate(v, self.grid, self.rates).reshape(2, 2, -1)
        far = np.array([self.model.cooling.cdf(v), self.model.heating.cdf(v)])
        weight = self.weight + _SLOPE_TIE / (4 * far * (1 - far) + _SATURATED)
        return np.asarray(weight / (_STRAY * pairs.sum(axis=1) + _STRAY_LEAST))


def _interpolate(v: FloatArray, grid: FloatArray, rows: FloatArray) -> FloatArray:
    return np.array([np.interp(v, grid, row) for row in rows])
