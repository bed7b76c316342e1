"""Leave-one-out error of a fit, without fitting again: does it predict samples that it has not seen?

Near its minimum a least-squares fit is linear in the measured outputs. With the Jacobian J of all residuals, ties
included, and J_i its row of sample i, leaving sample i out turns its residual r_i into

    r_i/(1 - h_i)          h_i = J_i (JᵀJ)⁻¹ J_iᵀ,   its leverage in [0, 1]

(Allen's PRESS). A leverage near one means that a rule serves this sample alone; its residual then has no meaning. Free
rules do this on steep, sparsely sampled parts of a loop.

Noise and gaps both raise the error of a sample that is left out. With every other sample left out the usual bound is
1.2 times the training error, an excess variance of 0.44. Leaving one sample out of the *training* half opens a gap
twice as wide, and the excess at least doubles: the bound here is (1 + 2 · 0.44)^½ = 1.37.
"""

from __future__ import annotations

import numpy as np

from smadrive.numerics.arrays import FloatArray

CONFIRMED = 1.37
"""Leave-one-out error over training error up to which a fit counts as confirmed."""

_LEAST_FREEDOM = 0.02  # 1 - h of a sample that a rule serves alone
_REGULAR = 1e-10  # relative to the diagonal of JᵀJ


def leave_one_out_ratio(residuals: FloatArray, jacobian: FloatArray, samples: int, scatter: float) -> float:
    """Leave-one-out error over training error, both RMS.

    residuals, jacobian: all rows at the minimum, of the free variables; the first `samples` rows are measured cells.
    `scatter`: the sum of squares within the cells, which no model can explain.
    """
    error = residuals[:samples]
    left_out = error / np.maximum(1 - leverages(jacobian, samples), _LEAST_FREEDOM)
    training = float(error @ error) + scatter
    return float(np.sqrt((left_out @ left_out + scatter) / training)) if training > 0 else 1.0


def leverages(jacobian: FloatArray, samples: int) -> FloatArray:
    """Leverages h of the first `samples` rows."""
    hessian = jacobian.T @ jacobian
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    rows = jacobian[:samples] / scale
    solved = np.linalg.solve(hessian / scale / scale[:, None] + _REGULAR * np.eye(len(scale)), rows.T)
    return np.asarray(np.einsum("ij,ji->i", rows, solved))
