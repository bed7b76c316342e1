"""What the maths accepts as samples: finite float64 arrays of equal length. All else is a DataError with a cure."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smadrive.errors import DataError

FloatArray = NDArray[np.float64]


def finite_array(name: str, values: ArrayLike) -> FloatArray:
    """`values` as a float64 array of one or two dimensions with at least one row.

    Raises DataError that names the first sample that is not finite.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name}: expected numbers, got {error}; pass an array of floats") from error
    if array.ndim not in (1, 2) or array.shape[0] == 0:
        raise DataError(
            f"{name}: shape {array.shape}; expected (samples,) or (samples, wires) with at least one sample"
        )
    bad = ~np.isfinite(array)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise DataError(
            f"{name}: sample {where[0]} is {array[where]}; drop or repair the {int(bad.sum())} such sample(s)"
        )
    return array


def paired_vectors(v: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Input and output samples as two finite vectors of one length. Raises DataError."""
    inputs, outputs = finite_array("input v", v), finite_array("output y", y)
    if inputs.ndim != 1 or outputs.ndim != 1:
        raise DataError(f"v {inputs.shape} and y {outputs.shape}: identification takes one wire, pass 1-D arrays")
    if len(inputs) != len(outputs):
        raise DataError(f"v has {len(inputs)} samples and y has {len(outputs)}; they must pair up one to one")
    return inputs, outputs
