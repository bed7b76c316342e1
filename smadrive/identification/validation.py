"""Training and validation: a fit to every other sample, judged on the samples between.

The samples left out are reached along the whole record's path, through the same turning points; only their outputs are
hidden from the fit. Near samples of one record share its drift and its loop, so this finds rules that follow single
samples; what a model is worth on another loop only another record tells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from smadrive.hysteresis.arrays import paired_vectors
from smadrive.identification.quality import rms_percent
from smadrive.identification.record import prepare

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis import HysteresisModel
    from smadrive.hysteresis.arrays import FloatArray
    from smadrive.identification.quality import Fit


@dataclass(frozen=True, slots=True)
class HoldOut:
    """RMS errors of one half of a record, % of the output span: of the samples fitted, and of those between."""

    training_percent: float
    validation_percent: float

    @property
    def ratio(self) -> float:
        """Validation over training: 1 for a fit that says as much of samples it has not seen."""
        return self.validation_percent / self.training_percent


def hold_out(
    v: ArrayLike, y: ArrayLike, identify: Callable[[FloatArray, FloatArray], Fit[HysteresisModel]]
) -> tuple[HoldOut, HoldOut]:
    """Fit the even samples of a record and judge on the odd ones, then the other way round.

    `identify` is a fit as a function of (v, y), such as identify_tsfuzzy. Raises what it raises for half a record.
    """
    inputs, outputs = paired_vectors(v, y)
    whole = prepare(inputs, outputs, None)
    halves = []
    for first in (0, 1):
        fitted, between = slice(first, None, 2), slice(1 - first, None, 2)
        fit = identify(inputs[fitted], outputs[fitted])
        error = (fit.model.simulate(whole.path, fit.y0) - outputs)[between]
        training = rms_percent(fit.residual, whole.output_span)
        halves.append(HoldOut(training, rms_percent(error, whole.output_span)))
    return halves[0], halves[1]
