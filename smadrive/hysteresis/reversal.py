"""Dead band against false reversals.

Noise on v turns the input round at every sample; a hysteresis model answers each turn with a minor loop and ratchets. A
play operator of width 2r lets only reversals larger than 2r through:

    p_k = min(max(p_{k-1}, v_k - r), v_k + r)

but it lags v by about r, and at mid-loop a kelvin of lag is 5 % of the stroke. The lag is known from the direction s of
the play's last move, so the filter gives out u = p + r s: the largest input since the last true turn on the way up, the
smallest on the way down. A reversal smaller than 2r leaves u where it was; a larger one is followed at once. A few
standard deviations of the noise are enough for r.

The extreme of many noisy samples lies outside the true turn, by a few standard deviations where the input turns slowly,
and every state after it keeps the error. Over a record, where the future is known, a turn is what the samples around it
say: a parabola on either side, both through the turn, fitted to those within a few radii.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import isotonic_regression

from smadrive.errors import ModelError
from smadrive.numerics.arrays import FloatArray, finite_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_AROUND = 3.0  # radii of input around a turn from which it is estimated
_LEAST_SAMPLES = 4  # on either side, for a parabola that is not the noise


class DeadBand:
    """The filter in real time; radius r in the unit of v. Raises ModelError for a negative radius."""

    def __init__(self, radius: float) -> None:
        self.radius = check_radius(radius)
        self._play: float | None = None
        self._direction = 0

    def update(self, v: float) -> float:
        """Take one sample and return u."""
        before = v if self._play is None else self._play
        self._play = min(max(before, v - self.radius), v + self.radius)
        if self._play != before:
            self._direction = 1 if self._play > before else -1
        return self._play + self._direction * self.radius


def filter_reversals(v: ArrayLike, radius: float) -> FloatArray:
    """The filter over a path of samples (1-D), as `DeadBand` gives it sample by sample."""
    band = DeadBand(radius)
    return np.array([band.update(sample) for sample in finite_array("input v", v).tolist()])


def turning_points(v: FloatArray, radius: float) -> list[int]:
    """Indices at which v turns by more than 2r, both ends included."""
    moved = np.diff(filter_reversals(v, radius))
    moving = np.flatnonzero(moved)
    rising = moved[moving] > 0
    corners = [0]
    for change in np.flatnonzero(rising[1:] != rising[:-1]):
        start, end = corners[-1], int(moving[change + 1]) + 1
        part = v[start : end + 1]
        corners.append(start + int(np.argmax(part) if rising[change] else np.argmin(part)))
    return [*corners, len(v) - 1]


def monotone_runs(v: FloatArray, radius: float) -> FloatArray:
    """The path without its false reversals: between true turning points the monotone path nearest to v.

    For recorded data, where the future is known: the noise is averaged instead of followed to its extremes.
    """
    corners = turning_points(v, radius)
    turned, result = v.copy(), v.copy()
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        turned[corner] = _turn(v[before : after + 1], corner - before, radius)
    for start, end in pairwise(corners):
        part, ends = slice(start, end + 1), np.sort(turned[[start, end]])
        nearest = isotonic_regression(turned[part], increasing=bool(turned[end] >= turned[start]))
        result[part] = np.clip(nearest.x, *ends)
    return result


def _turn(v: FloatArray, corner: int, radius: float) -> float:
    """The input at a turn, from two runs of samples that meet in v[corner], their extreme; within `radius` of it."""
    far = np.flatnonzero(np.abs(v - v[corner]) > _AROUND * radius)
    first, last = np.searchsorted(far, corner) - 1, np.searchsorted(far, corner)
    start = far[first] + 1 if first >= 0 else 0
    end = far[last] if last < len(far) else len(v)
    if min(corner - start, end - 1 - corner) < _LEAST_SAMPLES:
        return float(v[corner])
    place = (np.arange(start, end) - corner) / (end - start)
    before, after = np.minimum(place, 0.0), np.maximum(place, 0.0)
    terms = np.column_stack([np.ones_like(place), before, before**2, after, after**2])
    turn = np.linalg.lstsq(terms, v[start:end])[0][0]
    return float(np.clip(turn, v[corner] - radius, v[corner] + radius))


def check_radius(radius: float) -> float:
    """Refuse a negative or infinite radius (ModelError)."""
    if not (np.isfinite(radius) and radius >= 0):
        raise ModelError(f"dead band radius is {radius}; it must be finite and not negative")
    return float(radius)
