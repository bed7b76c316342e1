"""Training and validation: a fit to every other sample, validated on the samples between.

Only outputs are hidden from the fit. The state of the wire depends on the whole path of the input, so the fit follows
the path of the whole record. Each fit also uses all turning points of the record, and the validation leaves them out.
(Samples between turning points can be left out without a change of the path, because the models step exactly over any
distance.)

Where the output jumps between two samples, on steep and sparsely sampled parts of a loop, no fit can predict the values
between them. The error of linear interpolation between the fitted neighbours measures how large this effect is.

Hold-out reveals rules that follow single samples. It does not show the error on another loop, because neighbouring
samples of one record share the loop and the drift. Only another record shows the error on another loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from smadrive.identification.quality.metrics import rms_percent
from smadrive.identification.record import Record, prepare
from smadrive.numerics.arrays import paired_vectors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis import HysteresisModel
    from smadrive.identification.quality.metrics import Fit
    from smadrive.numerics.arrays import FloatArray


class Identify(Protocol):
    """A function that fits a model to the input v and the output y, such as identify_tsfuzzy.

    `dead_band` is the radius of the reversal filter, in the unit of v.
    """

    def __call__(self, v: FloatArray, y: FloatArray, *, dead_band: float) -> Fit[HysteresisModel]:
        """Fit a model to v and y, both (samples,), and return the model with its metrics."""


@dataclass(frozen=True, slots=True)
class HoldOut:
    """RMS errors of a fit to one half of a record, % of the output span.

    training_percent     error of the fit at the fitted samples
    validation_percent   error of the fit at the samples between, which the fit did not use
    neighbours_percent   error of straight lines through the fitted samples, at the samples between
    """

    training_percent: float
    validation_percent: float
    neighbours_percent: float

    @property
    def ratio(self) -> float:
        """Validation error over training error.

        It is 1 if the fit is as good at the samples between as at the fitted samples.
        """
        return self.validation_percent / self.training_percent


def hold_out(v: ArrayLike, y: ArrayLike, identify: Identify) -> tuple[HoldOut, HoldOut]:
    """Fit the even samples of a record and validate on the odd samples, then the other way round; return both results.

    v and y are (samples,). DataError for samples that cannot be used, and the errors of `identify` when it cannot fit
    half of the record.
    """
    inputs, outputs = paired_vectors(v, y)
    whole = prepare(inputs, outputs, None)
    return _half(whole, 0, identify), _half(whole, 1, identify)


def _half(whole: Record, first: int, identify: Identify) -> HoldOut:
    path, y = whole.path, whole.y
    fitted = whole.corners.copy()
    fitted[first::2] = True
    fit = identify(path[fitted], y[fitted], dead_band=0.0)
    error = fit.model.simulate(path, fit.y0) - y
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path)))])
    lines = np.interp(travel, travel[fitted], y[fitted]) - y
    return HoldOut(*(rms_percent(part, whole.output_span) for part in (error[fitted], error[~fitted], lines[~fitted])))
