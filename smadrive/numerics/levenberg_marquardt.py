"""Bounded least squares for many samples and few variables: Levenberg-Marquardt on the normal equations.

    minimise |r(x)|²/2, low ≤ x ≤ high:    (H + λ diag H) s = -g on the free variables,  H = JᵀJ,  g = Jᵀr

r are the residuals, x the variables with the bounds low and high. J is the Jacobian ∂r/∂x, s the step of x, λ the
damping. A variable is free unless it is at a bound and a step downhill would cross this bound. Each iteration factors
one matrix, whose size is at most the number of variables. scipy's bounded solvers decompose the whole Jacobian instead.
With threaded linear algebra on a busy machine, this takes a hundred times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import scipy

from smadrive.numerics.arrays import FloatArray

_DIFFERENCE = 1e-6
_PIECE = 64  # rows
_SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-12, 1e8


class Minimum(NamedTuple):
    """The values `x` of the variables at the minimum, and the cost there: half the sum of the squared residuals."""

    x: FloatArray
    cost: float


def minimise(
    residuals: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], Iterable[FloatArray]],
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    *,
    iterations: int,
    tolerance: float,
) -> Minimum:
    """Return the minimum of half the sum of the squared residuals, found from `start` within `bounds`.

    `start` and the two `bounds`, low and high, have the shape (variables,). `residuals` returns the residuals of given
    variables, (rows,). `jacobian` yields their derivatives in blocks of shape (some rows, variables). The search ends
    when a step lowers the cost by less than the share `tolerance`, when no step lowers the cost, or after `iterations`
    steps.
    """
    low, high = bounds
    x = np.clip(start, low, high)
    error = residuals(x)
    cost, damping = 0.5 * float(error @ error), 1e-3
    for _ in range(iterations):
        hessian, gradient = _normal_equations(jacobian(x), error)
        free = np.flatnonzero(~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))))
        before = cost
        while damping < _LARGEST_DAMPING:
            trial = x.copy()
            trial[free] += _step(hessian[np.ix_(free, free)], gradient[free], damping)
            trial = np.clip(trial, low, high)
            trial_error = residuals(trial)
            trial_cost = 0.5 * float(trial_error @ trial_error)
            if trial_cost < cost:
                x, error, cost = trial, trial_error, trial_cost
                damping = max(damping / 5, _SMALLEST_DAMPING)
                break
            damping *= 4
        if before - cost <= tolerance * before:
            break
    return Minimum(x, cost)


def forward_differences(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return the Jacobian of `function` at x by forward differences, shape (values, variables).

    The step of each variable is 1e-6, which suits variables of order one.
    """
    base = function(x)
    return np.column_stack([(function(moved) - base) / _DIFFERENCE for moved in x + _DIFFERENCE * np.eye(len(x))])


def _normal_equations(blocks: Iterable[FloatArray], error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return H and g, summed over products that are too small for BLAS to start threads (see blas_threads.py)."""
    hessian, gradient, start = np.zeros(()), np.zeros(()), 0
    for rows in blocks:
        errors, even = error[start : start + len(rows)], len(rows) - len(rows) % _PIECE
        start += len(rows)
        whole = rows[:even].reshape(-1, _PIECE, rows.shape[1]), errors[:even].reshape(-1, 1, _PIECE)
        rest = rows[None, even:], errors[None, None, even:]
        for pieces, their_errors in (whole, rest):
            hessian = hessian + np.matmul(pieces.transpose(0, 2, 1), pieces).sum(axis=0)
            gradient = gradient + np.matmul(their_errors, pieces).sum(axis=(0, 1))
    return hessian, gradient


def _step(hessian: FloatArray, gradient: FloatArray, damping: float) -> FloatArray:
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / scale / scale[:, None] + damping * np.eye(len(gradient))
    try:
        return np.asarray(-scipy.linalg.solve(scaled, gradient / scale, assume_a="pos") / scale)
    except scipy.linalg.LinAlgError:
        return np.zeros_like(gradient)
