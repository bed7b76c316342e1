"""Fuzzy sets on the input v and the rules of the T-S fuzzy Duhem model, Eqs. (7)-(11) of the paper.

    IF v is about c_i AND v rises (falls) THEN dw = (a_i w + b_i) dv

The sets overlap to one everywhere (a partition of unity), so the blended law is a(v) = Σ μ_i(v) a_i. The second premise
has two crisp sets, the direction of v. The paper's time form dx/dt = A_i x + B_i is A_i = a_i dv/dt, B_i = b_i dv/dt:
with constant A_i, B_i the model would not be rate-independent, so the rules multiply dv.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from smadrive.errors import ModelError
from smadrive.files.number_text import shortened
from smadrive.numerics.arrays import FloatArray

MOST_SETS = 200
"""The weights of 20,000 sets at every point of the finest grid would take 100 GB; a wire needs about 11."""


class Rule(NamedTuple):
    """One rule: premise (centre of the set on v, direction +1 or -1) and consequent dw = (a w + b) dv."""

    centre: float
    direction: int
    a: float
    b: float

    def __str__(self) -> str:
        motion = "rises" if self.direction > 0 else "falls"
        return f"IF v is about {self.centre:.6g} AND v {motion} THEN dw = ({self.a:+.6g} w {self.b:+.6g}) dv"

    def time_law(self, rate: float) -> tuple[float, float]:
        """A and B of the paper's Eq. (11) at the input rate dv/dt, in 1/s."""
        return self.a * rate, self.b * rate


class FuzzySets(Protocol):
    """A partition of unity over v: centres, membership weights, and where the weights have kinks."""

    @property
    def centres(self) -> tuple[float, ...]:
        """Centres, ascending."""

    @property
    def kinks(self) -> FloatArray:
        """Inputs at which the weights are not smooth."""

    def weights(self, v: FloatArray) -> FloatArray:
        """Memberships, shape v.shape + (sets,), summing to one."""


@dataclass(frozen=True, slots=True)
class TriangularSets:
    """Triangles from centre to centre, shoulders outside: the paper's Figure 8. The blended law is piecewise linear."""

    centres: tuple[float, ...]

    def __post_init__(self) -> None:
        check_centres(self.centres)

    @property
    def kinks(self) -> FloatArray:
        """See FuzzySets."""
        return np.array(self.centres)

    def weights(self, v: FloatArray) -> FloatArray:
        """See FuzzySets."""
        return hat_weights(np.asarray(v), np.array(self.centres))


@dataclass(frozen=True, slots=True)
class TrapezoidSets:
    """Trapezoids: the share `flat` (0 ≤ flat < 1) of each gap between centres belongs to the tops of its two sets."""

    centres: tuple[float, ...]
    flat: float

    def __post_init__(self) -> None:
        check_centres(self.centres)
        if not 0 <= self.flat < 1:
            raise ModelError("outside [0, 1)", where="trapezoid sets: flat", value=self.flat)

    @property
    def kinks(self) -> FloatArray:
        """See FuzzySets."""
        return np.sort(np.concatenate(self._slopes()))

    def _slopes(self) -> tuple[FloatArray, FloatArray]:
        centres = np.array(self.centres)
        margin = np.diff(centres) * self.flat / 2
        return centres[:-1] + margin, centres[1:] - margin

    def weights(self, v: FloatArray) -> FloatArray:
        """See FuzzySets."""
        start, end = self._slopes()
        ramps = np.clip((np.asarray(v)[..., None] - start) / (end - start), 0.0, 1.0)
        edge = np.ones((*ramps.shape[:-1], 1))
        return np.asarray(np.concatenate([edge, ramps], axis=-1) - np.concatenate([ramps, 0 * edge], axis=-1))


@dataclass(frozen=True, slots=True)
class GaussianSets:
    """Bells exp(-(v - c)²/(2 width²)), normalised to sum one; smooth, every rule a little active everywhere."""

    centres: tuple[float, ...]
    width: float

    def __post_init__(self) -> None:
        check_centres(self.centres)
        if not (np.isfinite(self.width) and self.width > 0):
            raise ModelError("not finite and positive", where="Gaussian sets: width", value=self.width)

    @property
    def kinks(self) -> FloatArray:
        """See FuzzySets."""
        return np.empty(0)

    def weights(self, v: FloatArray) -> FloatArray:
        """See FuzzySets."""
        exponents = -0.5 * ((np.asarray(v)[..., None] - np.array(self.centres)) / self.width) ** 2
        bells = np.exp(exponents - exponents.max(axis=-1, keepdims=True))
        return np.asarray(bells / bells.sum(axis=-1, keepdims=True))


def hat_weights(v: FloatArray, centres: FloatArray) -> FloatArray:
    """Memberships of triangular sets with shoulders, shape v.shape + (sets,)."""
    held = np.clip(v, centres[0], centres[-1]).ravel()
    left = np.clip(np.searchsorted(centres, held, side="right") - 1, 0, len(centres) - 2)
    share = (held - centres[left]) / (centres[left + 1] - centres[left])
    weights, sample = np.zeros((len(held), len(centres))), np.arange(len(held))
    weights[sample, left] = 1 - share
    weights[sample, left + 1] = share
    return weights.reshape(*np.shape(v), len(centres))


def check_centres(centres: tuple[float, ...]) -> None:
    """Raise ModelError unless the centres are 2 to `MOST_SETS` finite ascending numbers."""
    if len(centres) < 2:
        raise ModelError("too few centres", where="sets", value=len(centres), limit=2)
    if len(centres) > MOST_SETS:
        raise ModelError("too many centres", where="sets", value=len(centres), limit=MOST_SETS, cure="use fewer sets")
    steps = np.diff(np.array(centres, dtype=np.float64))
    if not (np.isfinite(steps).all() and (steps > 0).all()):
        value = shortened(tuple(centres))
        raise ModelError("not finite and strictly ascending", where="sets: centres", value=value)
