"""Leave-one-out error of a fit: its error at samples that it did not use, computed without new fits.

Near its minimum a least-squares fit is linear in the measured outputs. J is the Jacobian of all residuals, including
the ties of the rules to the prior, and J_i is its row of sample i. Without sample i, the residual r_i becomes

    r_i/(1 - h_i)          h_i = J_i (JᵀJ)⁻¹ J_iᵀ,   the leverage of sample i, in [0, 1]

(Allen's PRESS). A leverage near 1 means that a rule follows this sample alone. Then the residual of the sample has no
meaning. This happens with free rules on steep, sparsely sampled parts of a loop.

Noise and gaps both raise the error at a sample that the fit did not use. If this error is twice the training error,
three quarters of its square come from rules that followed the sample.
"""

from __future__ import annotations

import numpy as np

from smadrive.numerics.arrays import FloatArray

FOLLOWS_SAMPLES = 2.0
"""Above this ratio of leave-one-out error to training error, rules of a fit follow single samples."""

_UNCERTAIN = 2.0  # factor of the leave-one-out error of rules that follow single samples: it is uncertain
_LEAST_FREEDOM = 0.02  # smallest 1 - h that is used: h is near 1 for a sample that alone determines a rule
_REGULAR = 1e-10  # relative to the diagonal of JᵀJ


def leave_one_out_ratio(residuals: FloatArray, jacobian: FloatArray, samples: int, scatter: float) -> float:
    """Return the leave-one-out error divided by the training error, both RMS.

    `residuals` (rows,) and `jacobian` (rows, free variables) are taken at the minimum of a fit. The first `samples`
    rows belong to the cells of the record, the other rows to the prior and to penalties. A cell is the mean of
    neighbouring samples. `scatter` is the sum of squares of the samples about these means; no model can explain it.
    """
    error = residuals[:samples]
    left_out = error / np.maximum(1 - leverages(jacobian, samples), _LEAST_FREEDOM)
    training = float(error @ error) + scatter
    return float(np.sqrt((left_out @ left_out + scatter) / training)) if training > 0 else 1.0


def cautious_error(training_error: float, ratio: float) -> float:
    """Return the leave-one-out error by which fits are compared, in the unit of `training_error`.

    `ratio` is that of `leave_one_out_ratio`. The error counts `_UNCERTAIN` times if rules follow single samples.
    """
    return training_error * ratio * (_UNCERTAIN if ratio > FOLLOWS_SAMPLES else 1.0)


def leverages(jacobian: FloatArray, samples: int) -> FloatArray:
    """Return the leverages of the first `samples` rows of `jacobian`, shape (samples,).

    The leverage of a row tells how much the fit follows this row alone, from 0 to 1. `jacobian` (rows, free variables)
    is taken at the minimum of a fit.
    """
    hessian = jacobian.T @ jacobian
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    rows = jacobian[:samples] / scale
    solved = np.linalg.solve(hessian / scale / scale[:, None] + _REGULAR * np.eye(len(scale)), rows.T)
    return np.asarray(np.einsum("ij,ji->i", rows, solved))
