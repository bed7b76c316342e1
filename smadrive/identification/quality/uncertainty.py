"""Standard errors of the parameters of a least-squares fit.

    cov θ = G C Gᵀ        C = s² (JᵀJ)⁺        s² = |r|²/(n - p) · (1 + ρ)/(1 - ρ)

θ are the parameters, x the p variables of the fit, and r the residuals of the n samples. J = ∂r/∂x is the Jacobian at
the minimum, G = ∂θ/∂x, C the covariance of x, and s² the variance of a residual. No model is exact, so neighbouring
residuals are correlated. With the correlation ρ, n samples contain as much information as n (1 - ρ)/(1 + ρ) independent
samples. The pseudo-inverse ⁺ leaves out directions of x that do not change the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.residuals import samples_per_independent

_RANK = 1e-12  # relative tolerance of the rank of the normal matrix, whose diagonal is scaled to one


@dataclass(frozen=True, slots=True)
class MixtureErrors:
    """Standard errors of the Gaussians of a branch, one per Gaussian; for means and sigmas in the unit of v."""

    weights: tuple[float, ...]
    means: tuple[float, ...]
    sigmas: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class DuhemErrors:
    """Standard errors of the parameters of a Duhem model, each under the name of its parameter."""

    heating: MixtureErrors
    cooling: MixtureErrors
    scale: float
    offset: float


def standard_errors(jacobian: FloatArray, parameter_slopes: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the standard errors of the parameters of a fit, shape (parameters,).

    `jacobian` (rows, variables) holds the derivatives of the residuals with respect to the variables of the fit. A row
    may stand for several samples if it is weighted with the square root of their number. `parameter_slopes`
    (parameters, variables) holds the derivatives of the parameters with respect to the variables. `residual` (samples,)
    has the unit of the rows, in the order of time.
    """
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=0), 1e-300))
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=_RANK, hermitian=True)
    freedom = max(len(residual) - jacobian.shape[1], 1)
    variance = float(residual @ residual) / freedom * samples_per_independent(residual)
    turned = parameter_slopes / scale
    return np.asarray(np.sqrt(np.maximum(variance * np.einsum("ij,jk,ik->i", turned, inverse, turned), 0.0)))
