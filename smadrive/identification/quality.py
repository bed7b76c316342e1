"""How well an identified model reproduces its record.

All figures are in per cent of the output's span in the record (peak to peak), of the difference predicted - measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from smadrive.hysteresis import Certificate, HysteresisModel
    from smadrive.hysteresis.arrays import FloatArray

ModelT = TypeVar("ModelT", bound="HysteresisModel")


@dataclass(frozen=True, slots=True)
class Fit(Generic[ModelT]):
    """An identified model and its figures.

    path       input without false reversals, as the model saw it
    predicted  the model's output on that path, from `y0`
    residual   predicted - measured, one per sample, in the unit of y
    """

    model: ModelT
    path: FloatArray
    predicted: FloatArray
    residual: FloatArray
    output_span: float
    certificate: Certificate

    @property
    def rms_percent(self) -> float:
        """Root mean square residual, % of the output span."""
        return rms_percent(self.residual, self.output_span)

    @property
    def max_percent(self) -> float:
        """Largest residual, % of the output span."""
        return float(100 * np.max(np.abs(self.residual)) / self.output_span)

    @property
    def y0(self) -> float:
        """Output at the first sample from which the model was run."""
        return float(self.predicted[0])


def rms_percent(residual: FloatArray, span: float) -> float:
    """Root mean square of `residual` in per cent of `span`."""
    return float(100 * np.sqrt(np.mean(np.square(residual))) / span)


def judge(model: ModelT, path: FloatArray, y: FloatArray, y0: float) -> Fit[ModelT]:
    """Run `model` along the path of a record from output y0 and compare."""
    predicted = model.simulate(path, y0)
    return Fit(model, path, predicted, predicted - y, float(np.ptp(y)), model.certificate())
