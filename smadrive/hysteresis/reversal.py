"""Dead band against false reversals.

Noise on v turns the input round at every sample; a hysteresis model answers each turn with a minor loop and ratchets. A
play operator of width 2r lets only reversals larger than 2r through:

    p_k = min(max(p_{k-1}, v_k - r), v_k + r)

Its output lags v by r in the direction of motion, and stands still while v turns within the band. A few standard
deviations of the noise are enough for r. Used alike in identification and in real time.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import isotonic_regression

from smadrive.errors import ModelError
from smadrive.hysteresis.arrays import FloatArray, finite_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class DeadBand:
    """The play operator in real time: radius r in the unit of v, held value p (None before the first sample)."""

    def __init__(self, radius: float) -> None:
        self.radius = check_radius(radius)
        self.held: float | None = None

    def update(self, v: float) -> float:
        """Take one sample and return p."""
        held = v if self.held is None else self.held
        self.held = min(max(held, v - self.radius), v + self.radius)
        return self.held


def play(v: ArrayLike, radius: float) -> FloatArray:
    """The play operator over a path of samples (1-D), starting at p = v[0]."""
    path = finite_array("input v", v)
    band = DeadBand(radius)
    return np.array([band.update(sample) for sample in path.tolist()])


def turning_points(v: FloatArray, radius: float) -> list[int]:
    """Indices at which v turns by more than 2r, both ends included: the extremes between moves of the play."""
    moved = np.diff(play(v, radius))
    moving = np.flatnonzero(moved)
    rising = moved[moving] > 0
    changes = np.flatnonzero(rising[1:] != rising[:-1])
    corners = [0]
    for change in changes:
        start, end = corners[-1], int(moving[change + 1]) + 1
        part = v[start : end + 1]
        corners.append(start + int(np.argmax(part) if rising[change] else np.argmin(part)))
    return [*corners, len(v) - 1]


def monotone_runs(v: FloatArray, radius: float) -> FloatArray:
    """The path without its false reversals: between true turning points the monotone path nearest to v.

    For recorded data, where the future is known: unlike the play operator it does not lag.
    """
    corners = turning_points(v, radius)
    result = v.copy()
    for start, end in pairwise(corners):
        part = slice(start, end + 1)
        result[part] = isotonic_regression(v[part], increasing=bool(v[end] >= v[start])).x
    return result


def check_radius(radius: float) -> float:
    """Refuse a negative or infinite radius (ModelError)."""
    if not (np.isfinite(radius) and radius >= 0):
        raise ModelError(f"dead band radius is {radius}; it must be finite and not negative")
    return float(radius)
