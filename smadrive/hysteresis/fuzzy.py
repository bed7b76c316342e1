"""Fuzzy sets on the input v and the rules of the T-S fuzzy Duhem model, Eqs. (7)-(11) of the paper.

    IF v is about c_i AND v rises (falls) THEN dw = (a_i w + b_i) dv

c_i is the centre of the fuzzy set i, w the state, and a_i and b_i are the consequent of the rule. The memberships μ_i
of the sets have the sum 1 at every v (a partition of unity). So the rules blend into one law:

    dw/dv = a(v) w + b(v)          a(v) = Σ μ_i(v) a_i          b(v) = Σ μ_i(v) b_i

The second premise has two crisp sets, the two directions of v. The paper writes the rules over the time t, with x for
the state w:

    dx/dt = A_i x + B_i            A_i = a_i dv/dt              B_i = b_i dv/dt

With constant A_i and B_i the model would depend on the rate of the input, so the rules here multiply dv.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple, Protocol

import numpy as np

from smadrive.errors import ModelError
from smadrive.files.number_text import shortened
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import real_number

MOST_SETS = 200
"""The largest number of sets. A wire needs about 11. With 20,000 sets, the computer would need 100 GB of memory."""


class Rule(NamedTuple):
    """One rule: IF v is about `centre` AND v rises or falls THEN dw = (a w + b) dv.

    v is the input and w the state. `direction` is +1 for rising v, -1 for falling v. a and b are in 1/(unit of v).
    """

    centre: float
    direction: int
    a: float
    b: float

    def __str__(self) -> str:
        motion = "rises" if self.direction > 0 else "falls"
        return f"IF v is about {self.centre:.6g} AND v {motion} THEN dw = ({self.a:+.6g} w {self.b:+.6g}) dv"


class FuzzySets(Protocol):
    """Fuzzy sets over the input v. At every v the memberships of all sets have the sum 1 (a partition of unity)."""

    @property
    def centres(self) -> tuple[float, ...]:
        """Centres of the sets, ascending, in the unit of v."""

    @property
    def kinks(self) -> FloatArray:
        """Inputs at which the memberships are not smooth, in the unit of v; empty if they are smooth everywhere."""

    def weights(self, v: FloatArray) -> FloatArray:
        """Return the memberships at v, shape v.shape + (sets,); their sum over the sets is 1."""


@dataclass(frozen=True, slots=True)
class TriangularSets:
    """Triangular fuzzy sets over the input v, as in Figure 8 of the paper.

    The membership of a set is 1 at its centre, and falls linearly to 0 at the two neighbouring centres. The first set
    keeps the membership 1 below its centre, and the last set above its centre (shoulders).
    """

    centres: tuple[float, ...]

    def __post_init__(self) -> None:
        check_centres(self.centres)

    @property
    def kinks(self) -> FloatArray:
        """The centres, at which the memberships are not smooth."""
        return np.array(self.centres)

    def weights(self, v: FloatArray) -> FloatArray:
        """Return the memberships at v, shape v.shape + (sets,); their sum over the sets is 1."""
        return hat_weights(np.asarray(v), np.array(self.centres))


@dataclass(frozen=True, slots=True)
class TrapezoidSets:
    """Trapezoidal fuzzy sets over the input v.

    On the share `flat` (0 ≤ flat < 1) of the distance between two neighbouring centres the memberships are constant:
    half of this share lies next to each of the two centres. Between these flat parts the memberships change linearly.
    """

    centres: tuple[float, ...]
    flat: float

    def __post_init__(self) -> None:
        check_centres(self.centres)
        if not 0 <= real_number(self.flat, "trapezoid sets: flat", ModelError) < 1:
            raise ModelError("must be at least 0 and less than 1", where="trapezoid sets: flat", value=self.flat)

    @property
    def kinks(self) -> FloatArray:
        """Inputs at which a flat part ends and the memberships begin to change, ascending, in the unit of v."""
        return np.sort(np.concatenate(self._slopes()))

    def _slopes(self) -> tuple[FloatArray, FloatArray]:
        centres = np.array(self.centres)
        margin = np.diff(centres) * self.flat / 2
        return centres[:-1] + margin, centres[1:] - margin

    def weights(self, v: FloatArray) -> FloatArray:
        """Return the memberships at v, shape v.shape + (sets,); their sum over the sets is 1."""
        start, end = self._slopes()
        ramps = np.clip((np.asarray(v)[..., None] - start) / (end - start), 0.0, 1.0)
        edge = np.ones((*ramps.shape[:-1], 1))
        return np.asarray(np.concatenate([edge, ramps], axis=-1) - np.concatenate([ramps, 0 * edge], axis=-1))


@dataclass(frozen=True, slots=True)
class GaussianSets:
    """Gaussian fuzzy sets exp(-(v - c)²/(2 width²)) with the centres c, divided by the sum of all sets.

    `width` has the unit of v. Every rule has a small effect at every input.
    """

    centres: tuple[float, ...]
    width: float

    def __post_init__(self) -> None:
        check_centres(self.centres)
        if not (isfinite(real_number(self.width, "Gaussian sets: width", ModelError)) and self.width > 0):
            raise ModelError("not a positive number", where="Gaussian sets: width", value=self.width)

    @property
    def kinks(self) -> FloatArray:
        """An empty array: these memberships are smooth everywhere."""
        return np.empty(0)

    def weights(self, v: FloatArray) -> FloatArray:
        """Return the memberships at v, shape v.shape + (sets,); their sum over the sets is 1."""
        exponents = -0.5 * ((np.asarray(v)[..., None] - np.array(self.centres)) / self.width) ** 2
        bells = np.exp(exponents - exponents.max(axis=-1, keepdims=True))
        return np.asarray(bells / bells.sum(axis=-1, keepdims=True))


def hat_weights(v: FloatArray, centres: FloatArray) -> FloatArray:
    """Return the memberships of TriangularSets with these `centres` at v, shape v.shape + (sets,)."""
    held = np.clip(v, centres[0], centres[-1]).ravel()
    left = np.clip(np.searchsorted(centres, held, side="right") - 1, 0, len(centres) - 2)
    share = (held - centres[left]) / (centres[left + 1] - centres[left])
    weights, sample = np.zeros((len(held), len(centres))), np.arange(len(held))
    weights[sample, left] = 1 - share
    weights[sample, left + 1] = share
    return weights.reshape(*np.shape(v), len(centres))


def check_centres(centres: object) -> None:
    """Raise ModelError unless the centres are 2 to `MOST_SETS` finite ascending numbers."""
    if not isinstance(centres, Sequence | np.ndarray):
        cure = "pass a tuple of numbers"
        raise ModelError("centres are not a sequence", where="sets", value=type(centres).__qualname__, cure=cure)
    for centre in centres:
        real_number(centre, "sets: centre", ModelError)
    if len(centres) < 2:
        raise ModelError("too few centres", where="sets", value=len(centres), limit="at least 2", cure="add centres")
    if len(centres) > MOST_SETS:
        raise ModelError("too many centres", where="sets", value=len(centres), limit=MOST_SETS, cure="use fewer sets")
    steps = np.diff(np.array(centres, dtype=np.float64))
    if not (np.isfinite(steps).all() and (steps > 0).all()):
        value = shortened(tuple(centres))
        raise ModelError("must be finite, and each larger than the one before", where="sets: centres", value=value)
