"""Metrics of an identified model on its record.

The metrics describe the residual, predicted - measured, in percent of the output span of the record (peak to peak).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.identification.quality.caveats import bridges_gaps, misses_record

if TYPE_CHECKING:
    from smadrive.hysteresis import Certificate, HysteresisModel
    from smadrive.identification.record import Record
    from smadrive.numerics.arrays import FloatArray

_EXPLAINED = 0.5  # least share of the output's variance that a model must explain

ModelT = TypeVar("ModelT", bound="HysteresisModel")


@dataclass(frozen=True, slots=True, repr=False)
class Fit(Generic[ModelT]):
    """An identified model and its metrics.

    model        the identified model
    path         input of the record without false reversals, (samples,)
    predicted    output of the model on this path, (samples,), simulated from `y0`
    residual     predicted - measured output, (samples,), in the unit of y
    output_span  highest - lowest measured output
    certificate  proven properties of the model
    caveats      reasons to distrust the model, one sentence each
    """

    model: ModelT
    path: FloatArray
    predicted: FloatArray
    residual: FloatArray
    output_span: float
    certificate: Certificate
    caveats: tuple[str, ...]

    @property
    def rms_percent(self) -> float:
        """Root mean square residual, % of the output span."""
        return rms_percent(self.residual, self.output_span)

    @property
    def max_percent(self) -> float:
        """Largest absolute residual, % of the output span."""
        return float(100 * np.max(np.abs(self.residual)) / self.output_span)

    def __repr__(self) -> str:
        certified = "certified" if self.certificate.holds else "not certified"
        samples = f"{len(self.residual)} samples"
        return f"Fit({self.rms_percent:.3g} % RMS, {self.max_percent:.3g} % at most, {samples}, {certified})"

    @property
    def metrics(self) -> dict[str, float]:
        """The values of `rms_percent` and `max_percent` by their names, as they are stored in the file of a wire."""
        return {"rms_percent": self.rms_percent, "max_percent": self.max_percent}

    @property
    def y0(self) -> float:
        """Output of the model at the first sample, from which the simulation starts."""
        return float(self.predicted[0])


def rms_percent(residual: FloatArray, span: float) -> float:
    """Return the root mean square of `residual` in percent of `span`."""
    return float(100 * np.sqrt(np.mean(np.square(residual))) / span)


def judge(model: ModelT, record: Record, y0: float) -> Fit[ModelT]:
    """Simulate `model` along the input path of `record` from the output `y0`, and return the model with its metrics.

    IdentificationError when the model explains less than half of the output's variance.
    """
    predicted = model.simulate(record.path, y0)
    residual = predicted - record.y
    explained = 1 - float(np.var(residual) / np.var(record.y))
    if explained < _EXPLAINED:
        cure = (
            "check that both columns belong to one wire; if its thermal expansion exceeds its transformation, subtract "
            "the slope of the hot end, times the input, from the output"
        )
        value, limit = f"{100 * explained:.0f} %", f"{100 * _EXPLAINED:.0f} %"
        what = "does not follow the input: a loop explains too little of its variance"
        raise IdentificationError(what, where="output", value=value, limit=limit, cure=cure)
    caveats = misses_record(rms_percent(residual, record.output_span)) + bridges_gaps(model, record)
    return Fit(model, record.path, predicted, residual, record.output_span, model.certificate(), caveats)
