"""Convex mixtures of Gaussian distributions: h±(v) of the Duhem model, with tails that never cancel.

    h(v) = Σ p_j Φ((v - μ_j)/σ_j),  g = h',  p_j > 0, Σ p_j = 1          one component: the paper's Eqs. (3) and (6)

Everything is offered in logarithms of h and of 1 - h, so ratios far out in the tails stay exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import fsum, isfinite

import numpy as np
from scipy.special import log_ndtr, ndtr

from smadrive.errors import ModelError
from smadrive.hysteresis.arrays import FloatArray

_LOG_ROOT_TWO_PI = 0.5 * np.log(2 * np.pi)


@dataclass(frozen=True, slots=True)
class GaussianMixture:
    """Weights, means and standard deviations of the components. Raises ModelError for what is no distribution."""

    weights: tuple[float, ...]
    means: tuple[float, ...]
    sigmas: tuple[float, ...]

    def __post_init__(self) -> None:
        if not len(self.weights) == len(self.means) == len(self.sigmas) > 0:
            raise ModelError(
                f"mixture: {len(self.weights)} weights, {len(self.means)} means and {len(self.sigmas)} sigmas; "
                "give one of each per component, at least one"
            )
        for mean, sigma in zip(self.means, self.sigmas, strict=True):
            if not (isfinite(mean) and isfinite(sigma) and sigma > 0):
                raise ModelError(
                    f"mixture component mu = {mean}, sigma = {sigma}: mu must be finite, sigma finite and positive"
                )
        if min(self.weights) <= 0 or abs(fsum(self.weights) - 1) > 1e-9:
            raise ModelError(
                f"mixture weights {self.weights}: each must be positive and their sum 1 (it is {fsum(self.weights):g})"
            )

    def span(self, sigmas: float) -> tuple[float, float]:
        """The interval that holds every component out to `sigmas` standard deviations."""
        return (
            min(m - sigmas * s for m, s in zip(self.means, self.sigmas, strict=True)),
            max(m + sigmas * s for m, s in zip(self.means, self.sigmas, strict=True)),
        )

    def _standard(self, v: FloatArray) -> FloatArray:
        return np.asarray((np.asarray(v)[..., None] - np.array(self.means)) / np.array(self.sigmas))

    def cdf(self, v: FloatArray) -> FloatArray:
        """h(v)."""
        return np.asarray(ndtr(self._standard(v)) @ np.array(self.weights))

    def log_cdf(self, v: FloatArray) -> FloatArray:
        """Logarithm of h(v)."""
        return self._log_blend(log_ndtr(self._standard(v)))

    def log_sf(self, v: FloatArray) -> FloatArray:
        """Logarithm of 1 - h(v)."""
        return self._log_blend(log_ndtr(-self._standard(v)))

    def log_pdf(self, v: FloatArray) -> FloatArray:
        """Logarithm of g(v)."""
        exponents = -0.5 * self._standard(v) ** 2 - _LOG_ROOT_TWO_PI
        return self._log_blend(exponents - np.log(self.sigmas))

    def _log_blend(self, logs: FloatArray) -> FloatArray:
        return np.asarray(np.logaddexp.reduce(logs + np.log(self.weights), axis=-1))
