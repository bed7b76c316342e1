"""Conversion of samples to finite float64 arrays. Samples that cannot be used raise DataError."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smadrive.errors import DataError

FloatArray = NDArray[np.float64]

_PARSED = "OUS"
"""Kinds of arrays whose values are converted one by one: objects and texts.

Of the other kinds, an unsafe conversion would also take complex numbers, dates and durations, and lose their meaning.
"""


def float_array(name: str, values: ArrayLike) -> FloatArray:
    """Return a copy of `values` as a float64 array of any shape.

    DataError about `name` when they are not real numbers, and when some of them are masked.
    """
    if isinstance(values, np.ma.MaskedArray) and (masked := int(np.sum(values.mask))):
        cure = "remove the masked values, or pass the array without its mask"
        raise DataError("has masked values", where=name, value=masked, cure=cure)
    try:
        array = np.asarray(values)
        if array.dtype.kind in _PARSED:
            return np.array(values, dtype=np.float64)
        return array.astype(np.float64, casting="same_kind")
    except (TypeError, ValueError, OverflowError) as error:
        raise DataError("not numbers", where=name, value=error, cure="pass an array of floats") from error


def finite_array(name: str, values: ArrayLike) -> FloatArray:
    """Return `values` as a finite float64 array of shape (samples,) or (samples, wires), with at least one sample.

    Raises DataError about `name` for other shapes and values. It names the first sample that is not finite.
    """
    array = float_array(name, values)
    if array.ndim not in (1, 2) or array.shape[0] == 0:
        cure = "pass the shape (samples,) or (samples, wires), with at least one sample"
        raise DataError("unusable shape", where=name, value=array.shape, cure=cure)
    bad = ~np.isfinite(array)
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        cure = f"remove or correct the samples that are not finite: {int(bad.sum())} in all"
        raise DataError("not finite", where=f"{name}: index {first[0]}", value=array[first], cure=cure)
    return array


def paired_vectors(
    v: ArrayLike, y: ArrayLike, names: tuple[str, str] = ("input v", "output y")
) -> tuple[FloatArray, FloatArray]:
    """Return inputs `v` and outputs `y` as two finite vectors of equal length.

    DataError for other samples; the error uses the two `names`.
    """
    inputs, outputs = (finite_array(name, values) for name, values in zip(names, (v, y), strict=True))
    where = f"{names[0]} and {names[1]}"
    if inputs.ndim != 1 or outputs.ndim != 1:
        shapes, cure = f"{inputs.shape} and {outputs.shape}", "pass 1-D arrays of one wire"
        raise DataError("not 1-D", where=where, value=shapes, cure=cure)
    if len(inputs) != len(outputs):
        lengths, cure = f"{len(inputs)} and {len(outputs)}", f"pass one {names[1]} for each {names[0]}"
        raise DataError("different numbers of samples", where=where, value=lengths, cure=cure)
    return inputs, outputs
