"""Stretches of a record in which the output reverses although the input does not.

A wire that only transforms has monotone branches; slopes of the wrong sign are then an error of the fit. A wire that
also expands with heat reverses where it is saturated, and a fit must reproduce this reversal. The record decides,
without a model: each monotone section of its input is compared with the nearest monotone curve of the output. Where
this curve is constant but the output is not, the output reverses. These stretches count only if the record is further
from monotone curves than measurement errors explain.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from smadrive.identification.record import Record
from smadrive.numerics.arrays import FloatArray

Mask = NDArray[np.bool_]

MATERIAL = 0.005
"""Largest RMS distance from monotone curves that counts as a measurement error, in output spans."""


@dataclass(frozen=True, slots=True)
class RecordReversals:
    """Ranges of the input in which the output of a record reverses although the input does not.

    `heating` and `cooling` hold one pair (from, to) for each range, in the unit of the input.
    """

    heating: tuple[tuple[float, float], ...] = ()
    cooling: tuple[tuple[float, float], ...] = ()

    def at(self, v: FloatArray) -> Mask:
        """Return a mask of shape (2, len(v)) that is True at the inputs v at which the output reverses.

        The first row belongs to heating, the second row to cooling.
        """
        found = np.zeros((2, len(v)), dtype=bool)
        for row, stretches in enumerate((self.heating, self.cooling)):
            for start, end in stretches:
                found[row] |= (start <= v) & (v <= end)
        return found


NOWHERE = RecordReversals()
"""The result for a wire with monotone branches."""


def find_record_reversals(record: Record) -> RecordReversals:
    """Return the ranges of the input in which the output of `record` reverses although the input does not.

    The result is empty (NOWHERE) if measurement errors explain these reversals.
    """
    rises = bool(np.corrcoef(record.v, record.mean_y)[0, 1] > 0)
    material = float(np.hypot(MATERIAL, record.noise))
    squares = 0.0
    stretches: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    for run in _runs(record.v):
        v, y, count = record.v[run], record.mean_y[run] / record.output_span, record.count[run]
        heating = bool(v[-1] > v[0])
        nearest = scipy.optimize.isotonic_regression(y, weights=count, increasing=heating == rises)
        squares += float(count @ (y - nearest.x) ** 2)
        for start, end in pairwise(nearest.blocks):
            if np.ptp(y[start:end]) > material:
                stretches[heating].append((float(v[start:end].min()), float(v[start:end].max())))
    if np.sqrt(squares / record.count.sum()) <= material:
        return NOWHERE
    return RecordReversals(tuple(stretches[True]), tuple(stretches[False]))


def _runs(v: FloatArray) -> list[slice]:
    """Return the monotone sections of v. A turning point belongs to the sections before and after it."""
    rising = v[1:] > v[:-1]
    corners = [0, *(np.flatnonzero(rising[1:] != rising[:-1]) + 1).tolist(), len(v) - 1]
    return [slice(start, end + 1) for start, end in pairwise(corners)]
