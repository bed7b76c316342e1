"""Dead band against false reversals.

Noise on v reverses the input at every sample. A hysteresis model answers each reversal with a minor loop and ratchets.
A play operator of width 2r passes only reversals larger than 2r:

    p_k = min(max(p_{k-1}, v_k - r), v_k + r)

It lags v by about r, and at mid-loop a kelvin of lag is 5 % of the stroke. The direction s of the play's last move
gives the sign of the lag, so the filter returns u = p + r s: the largest input since the last true reversal while v
rises, the smallest while v falls. A reversal smaller than 2r leaves u constant; u follows a larger one at once. A few
standard deviations of the noise are enough for r.

The extreme of many noisy samples lies outside the true turning point, by a few standard deviations where the input
reverses slowly, and every later state keeps the error. In a record the later samples are known: the turning point is
estimated from two parabolas, one on either side, fitted to the samples within a few radii.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression

from smadrive.errors import ModelError
from smadrive.numerics.arrays import FloatArray, finite_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_AROUND = 3.0  # radii of input around a turning point from which it is estimated
_LEAST_SAMPLES = 4  # on either side, for a parabola that does not follow the noise


class Play(NamedTuple):
    """State of the play operator: position p, and the direction of its last move (0 before the first one)."""

    position: float
    direction: int = 0

    def moved(self, v: float, radius: float) -> Play:
        """The state after the input has moved to v."""
        return Play(*_moved(self.position, self.direction, v, radius))

    def output(self, radius: float) -> float:
        """The filtered input u."""
        return self.position + self.direction * radius


def _moved(position: float, direction: int, v: float, radius: float) -> tuple[float, int]:
    """The play operator on plain numbers, which a loop calls for every sample."""
    if v - radius > position:
        return v - radius, 1
    if v + radius < position:
        return v + radius, -1
    return position, direction


class DeadBand:
    """The filter in real time; radius r in the unit of v. Raises ModelError for a negative radius."""

    def __init__(self, radius: float) -> None:
        self.radius = check_radius(radius)
        self._position: float | None = None
        self._direction = 0

    def update(self, v: float) -> float:
        """Take one sample and return u."""
        before = v if self._position is None else self._position
        self._position, self._direction = _moved(before, self._direction, v, self.radius)
        return self._position + self._direction * self.radius


def filter_reversals(v: ArrayLike, radius: float) -> FloatArray:
    """The filter over a path of samples (1-D), sample by sample as by `DeadBand`."""
    band = DeadBand(radius)
    return np.array([band.update(sample) for sample in finite_array("input v", v).tolist()])


def turning_points(v: FloatArray, radius: float) -> list[int]:
    """Indices at which v reverses by more than 2r, both ends included."""
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
    """The path without its false reversals: the monotone path nearest to v between true turning points.

    For records, where the later samples are known: noise is averaged instead of followed to its extremes.
    """
    corners = turning_points(v, radius)
    turned, result = v.copy(), v.copy()
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        turned[corner] = _turning_point(v[before : after + 1], corner - before, radius)
    for start, end in pairwise(corners):
        part, ends = slice(start, end + 1), np.sort(turned[[start, end]])
        nearest = isotonic_regression(turned[part], increasing=bool(turned[end] >= turned[start]))
        result[part] = np.clip(nearest.x, *ends)
    return result


def _turning_point(v: FloatArray, corner: int, radius: float) -> float:
    """The input at a turning point, from two runs that meet in their extreme v[corner]; within `radius` of it."""
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
    """The radius as a float. Raises ModelError for a negative or infinite one."""
    if not (np.isfinite(radius) and radius >= 0):
        raise ModelError("negative or not finite", where="radius of the dead band", value=radius)
    return float(radius)
