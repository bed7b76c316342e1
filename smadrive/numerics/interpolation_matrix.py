"""Matrices whose rows are weighted sums of a few rows of a smaller matrix, as in table interpolation.

Row i of the large matrix is Σ_j shares[i, j] rows[places[i, j]], where `rows` is the small matrix. A Jacobian along a
record has one row per sample, but its tables have far fewer nodes; the small matrix has one row per node. In this form,
scaling and the chain rule change only the small matrix. The large matrix is computed block by block, so that each block
is still in the cache of the processor when it is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from smadrive.numerics.arrays import FloatArray

_BLOCK = 1024  # rows


class InterpolationMatrix(NamedTuple):
    """A large matrix of shape (samples, columns), stored as weighted sums of the rows of a smaller matrix.

    `rows` (nodes, columns) is the smaller matrix. `places` and `shares` (samples, terms) are the indices and the
    weights of the rows that each sample adds up.
    """

    places: NDArray[np.int32]
    shares: FloatArray
    rows: FloatArray

    def blocks(self) -> Iterator[FloatArray]:
        """Yield the large matrix in blocks of at most 1024 rows."""
        for start in range(0, len(self.places), _BLOCK):
            yield self.at(slice(start, start + _BLOCK))

    def at(self, samples: slice | NDArray[np.intp]) -> FloatArray:
        """Return the rows of the large matrix for `samples`, which are indices or a slice."""
        places, shares = self.places[samples], self.shares[samples]
        ends = np.arange(0, places.size + 1, places.shape[1], dtype=np.int32)
        weights = scipy.sparse.csr_array((shares.ravel(), places.ravel(), ends), shape=(len(places), len(self.rows)))
        return np.asarray(weights @ self.rows)
