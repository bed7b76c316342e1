"""Dead band against false reversals.

Noise on the input v reverses v at every sample. A hysteresis model answers each reversal with an inner loop, so its
state drifts. A play operator with the radius r passes only reversals larger than 2r. Its position p_k after sample k is

    p_k = min(max(p_{k-1}, v_k - r), v_k + r)

The position p lags v by about r, and in the middle of the loop a lag of 1 K means 5 % of the stroke. The direction s of
the last move of p (+1 or -1) gives the sign of the lag, so the filter returns u = p + r s. While v rises, u is the
largest input since the last true reversal; while v falls, u is the smallest. A reversal smaller than 2r leaves u
constant, and u follows a larger reversal at once. A radius r of a few standard deviations of the noise is enough.

The extreme of many noisy samples lies beyond the true turning point, by a few standard deviations of the noise if the
input reverses slowly. The hysteresis model keeps this error from then on. A filter in real time cannot avoid it. In a
record, the samples after the turning point are known as well. So the turning point of a record is estimated from two
parabolas, one before and one after the turning point, fitted to the samples within a few radii.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.numerics.arrays import FloatArray, finite_array
from smadrive.numerics.scalars import real_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_AROUND = 3.0  # a turning point is estimated from the samples within this distance, in radii of the dead band
_LEAST_SAMPLES = 4  # on either side, for a parabola that does not follow the noise


class Play(NamedTuple):
    """State of the play operator: position p, and the direction of the last move of p (0 before the first move)."""

    position: float
    direction: int = 0

    def moved(self, v: float, radius: float) -> Play:
        """Return the state of the play operator after the input has moved to v. `radius` has the unit of v."""
        return Play(*_moved(self.position, self.direction, v, radius))

    def resized(self, before: float, radius: float) -> Play:
        """Return the state for `radius` with the same output. `before` is the present radius."""
        return Play(self.position + self.direction * (before - radius), self.direction)

    def output(self, radius: float) -> float:
        """Return the filtered input: the position, plus `radius` in the direction of the last move."""
        return self.position + self.direction * radius


def _moved(position: float, direction: int, v: float, radius: float) -> tuple[float, int]:
    """Return position and direction of the play operator after a move to v, as plain numbers because this is fast."""
    if v - radius > position:
        return v - radius, 1
    if v + radius < position:
        return v + radius, -1
    return position, direction


class DeadBand:
    """Removes reversals smaller than 2 · `radius` from an input in real time. The radius has the unit of the input.

    Raises ModelError for a negative or infinite radius.
    """

    def __init__(self, radius: float) -> None:
        self.radius = check_radius(radius)
        self._position: float | None = None
        self._direction = 0

    def update(self, v: float) -> float:
        """Take the sample v of the input, and return the filtered input."""
        before = v if self._position is None else self._position
        self._position, self._direction = _moved(before, self._direction, v, self.radius)
        return self._position + self._direction * self.radius


def filter_reversals(v: ArrayLike, radius: float) -> FloatArray:
    """Return a path `v` (samples,) without its reversals smaller than 2 · `radius`, as `DeadBand` removes them."""
    band = DeadBand(radius)
    return np.array([band.update(sample) for sample in finite_array("input v", v).tolist()])


def turning_points(v: FloatArray, radius: float) -> list[int]:
    """Return the indices of the first sample, of the turning points, and of the last sample of `v`.

    A turning point is a sample at which `v` reverses by more than 2 · `radius`.
    """
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
    """Return the input path `v` (samples,) without its false reversals, which are those below 2 · `radius`.

    Between true turning points the result is the monotone path with the smallest squared distance from `v`. This
    function needs a complete record. It averages the noise, while `DeadBand` follows the noise to its extremes.
    """
    corners = turning_points(v, radius)
    turned, result = v.copy(), v.copy()
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        turned[corner] = _turning_point(v[before : after + 1], corner - before, radius)
    for start, end in pairwise(corners):
        part, ends = slice(start, end + 1), np.sort(turned[[start, end]])
        nearest = scipy.optimize.isotonic_regression(turned[part], increasing=bool(turned[end] >= turned[start]))
        result[part] = np.clip(nearest.x, *ends)
    return result


def _turning_point(v: FloatArray, corner: int, radius: float) -> float:
    """Return the estimated input at a turning point, within `radius` of v[corner].

    `v` holds the monotone sections before and after the turning point; v[corner] is their common extreme.
    """
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
    """Return the radius as a float. Raises ModelError for a negative or infinite radius."""
    where = "radius of the dead band"
    number = real_number(radius, where, ModelError)
    if not (np.isfinite(number) and number >= 0):
        raise ModelError("negative or not finite", where=where, value=radius)
    return number
