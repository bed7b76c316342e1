"""Convex mixtures of Gaussian distributions: the branches h(v) of the Duhem model, exact far out in the tails.

    h(v) = Σ p_j Φ((v - μ_j)/σ_j),  g = h',  p_j > 0, Σ p_j = 1

Component j has the weight p_j, the mean μ_j and the standard deviation σ_j. Φ is the standard normal distribution
function, g the density. With one component these are Eqs. (3) and (6) of the paper. `GaussianMixture.logs` returns the
logarithms of h and of 1 - h, so that ratios far out in the tails stay exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum, isfinite
from typing import NamedTuple

import numpy as np
import scipy

from smadrive.errors import ModelError
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import real_number

_LOG_ROOT_TWO_PI = 0.5 * np.log(2 * np.pi)


MOST_COMPONENTS = 20
"""The largest number of components of one branch. A measured wire needs two."""


class MixtureLogs(NamedTuple):
    """Natural logarithms of a mixture at some inputs.

    cdf   of the distribution function h
    sf    of 1 - h
    pdf   of the density h', the derivative of h
    """

    cdf: FloatArray
    sf: FloatArray
    pdf: FloatArray


def _numbers(name: str, values: object) -> tuple[float, ...]:
    """Return the numbers of a sequence. ModelError if `values` is not a sequence of numbers."""
    where = f"mixture: {name}"
    if not isinstance(values, Sequence | np.ndarray):
        raise ModelError("not a sequence", where=where, value=type(values).__qualname__, cure="pass a tuple of numbers")
    return tuple(real_number(value, where, ModelError) for value in values)


@dataclass(frozen=True, slots=True)
class GaussianMixture:
    """A mixture of Gaussian distributions: weights, means and standard deviations of its components.

    Raises ModelError for invalid parameters.
    """

    weights: tuple[float, ...]
    means: tuple[float, ...]
    sigmas: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("weights", "means", "sigmas"):
            object.__setattr__(self, name, _numbers(name, getattr(self, name)))  # a list or an array has no hash
        if not len(self.weights) == len(self.means) == len(self.sigmas) > 0:
            counts = len(self.weights), len(self.means), len(self.sigmas)
            what = "unequal numbers of weights, means and sigmas, or no component"
            cure = "give a weight, a mean and a sigma for each component"
            raise ModelError(what, where="mixture", value=counts, cure=cure)
        if len(self.means) > MOST_COMPONENTS:
            raise ModelError("too many components", where="mixture", value=len(self.means), limit=MOST_COMPONENTS)
        for mean, sigma in zip(self.means, self.sigmas, strict=True):
            if not (isfinite(mean) and isfinite(sigma) and sigma > 0):
                cure = "give a finite mu, and a finite and positive sigma"
                raise ModelError("not a distribution", where="mixture (mu, sigma)", value=(mean, sigma), cure=cure)
        if not (min(self.weights) > 0 and abs(fsum(self.weights) - 1) <= 1e-9):  # a NaN fails, too
            raise ModelError("must be positive and have the sum 1", where="mixture: weights", value=self.weights)

    def span(self, sigmas: float) -> tuple[float, float]:
        """Return the smallest interval that contains each mean ± `sigmas` standard deviations of its component."""
        return (
            min(m - sigmas * s for m, s in zip(self.means, self.sigmas, strict=True)),
            max(m + sigmas * s for m, s in zip(self.means, self.sigmas, strict=True)),
        )

    def cdf(self, v: FloatArray) -> FloatArray:
        """Return the distribution function of the mixture at v, in the shape of v."""
        return np.asarray(np.tensordot(np.array(self.weights), scipy.special.ndtr(self._standard(v)), axes=1))

    def logs(self, v: FloatArray) -> MixtureLogs:
        """Return the logarithms of the distribution function h at v, of 1 - h and of the density h'.

        Each has the shape of v.
        """
        standard, log_weights = self._standard(v), np.log(self._column(self.weights, v))
        log_density = -0.5 * standard**2 - _LOG_ROOT_TWO_PI - np.log(self._column(self.sigmas, v))
        parts = scipy.special.log_ndtr(standard), scipy.special.log_ndtr(-standard), log_density
        return MixtureLogs(*(np.logaddexp.reduce(part + log_weights, axis=0) for part in parts))

    def _standard(self, v: FloatArray) -> FloatArray:
        """Return (v - mean) / sigma of every component, shape (components, *v.shape)."""
        return np.asarray((v - self._column(self.means, v)) / self._column(self.sigmas, v))

    def _column(self, values: tuple[float, ...], v: FloatArray) -> FloatArray:
        return np.reshape(values, (-1, *(1 for _ in np.shape(v))))
