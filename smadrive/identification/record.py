"""A measured record made ready for a fit: false reversals removed, checked for what it can determine, thinned.

The model is rate-independent and steps exactly, so samples between turning points carry no dynamics, only noise: within
a run, samples that share a cell of a few thousandths of the input span are replaced by their mean, with their count as
weight. Turning points stay unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis.reversal import check_radius, monotone_runs
from smadrive.numerics.arrays import FloatArray, paired_vectors

_CELLS = 150  # thinning cells over the input span
_NOISE_BAND = 4.0  # standard deviations of the input noise per dead band radius
_WIDEST_BAND = 0.025  # of the input span: coarse sampling must not pass for noise
_LEAST_COVERAGE = 0.6  # of the input span, in either direction


if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from smadrive.hysteresis import HysteresisModel


@dataclass(frozen=True, slots=True)
class Record:
    """Input path without false reversals and outputs, whole (`path`, `y`) and thinned (`v`, `mean_y`, `count`).

    `corners`: whether the path starts, turns or ends at a sample of the whole.
    `scatter`: sum of squares of y about the means of its cells, in output spans.
    """

    path: FloatArray
    y: FloatArray
    corners: NDArray[np.bool_]
    v: FloatArray
    mean_y: FloatArray
    count: FloatArray
    input_range: tuple[float, float]
    output_span: float
    noise: float
    scatter: float

    @property
    def rising(self) -> FloatArray:
        """Whether each thinned sample was reached by rising input (the first counts like the second)."""
        moves = self.v[1:] > self.v[:-1]
        return np.concatenate([moves[:1], moves])

    def misfit(self, model: HysteresisModel, y0: float) -> float:
        """RMS error of `model` from output y0 against the means of the cells, in output spans.

        The scatter within the cells, which no model explains, is not in it: it would hide what a change costs.
        """
        error = (model.simulate(self.v, y0) - self.mean_y) / self.output_span
        return float(np.sqrt(self.count @ error**2 / self.count.sum()))


def noise_deviation(samples: FloatArray) -> float:
    """Standard deviation of white noise on a smooth record, from the median absolute second difference."""
    if len(samples) < 5:
        return 0.0
    return float(np.median(np.abs(np.diff(samples, 2))) / 0.6745 / np.sqrt(6.0))


def prepare(v: ArrayLike, y: ArrayLike, dead_band: float | None) -> Record:
    """Check, clean and thin a record. `dead_band`: radius in the unit of v, None: from the noise of v.

    Raises DataError for samples that cannot be used, IdentificationError for records that determine no hysteresis.
    """
    inputs, outputs = paired_vectors(v, y)
    span, output_span = float(np.ptp(inputs)), float(np.ptp(outputs))
    if span == 0:
        raise IdentificationError("constant", where="input", value=inputs[0], cure="record at least one full loop")
    if output_span == 0:
        cure = "check the sensor and record a full loop"
        raise IdentificationError("constant", where="output", value=outputs[0], cure=cure)
    widest = _WIDEST_BAND * span
    radius = min(_NOISE_BAND * noise_deviation(inputs), widest) if dead_band is None else check_radius(dead_band)
    path = monotone_runs(inputs, radius)
    _require_loop(path, span)
    corners = _corners(path)
    thin_v, thin_y, count = _thin(path, outputs, corners, span / _CELLS)
    noise = noise_deviation(outputs) / output_span
    scatter = max(float(outputs @ outputs - count @ thin_y**2), 0.0) / output_span**2
    input_range = float(inputs.min()), float(inputs.max())
    return Record(path, outputs, corners, thin_v, thin_y, count, input_range, output_span, noise, scatter)


def _corners(path: FloatArray) -> NDArray[np.bool_]:
    moving = np.flatnonzero(np.diff(path))
    rising = np.diff(path)[moving] > 0
    turns = moving[1:][rising[1:] != rising[:-1]]
    corners = np.zeros(len(path), dtype=bool)
    corners[[0, -1]] = True
    corners[turns] = True
    return corners


def _require_loop(path: FloatArray, span: float) -> None:
    """Both directions must have been travelled over most of the input span."""
    moves = np.diff(path)
    edges = np.linspace(path.min(), path.max(), 101)
    for name, chosen in (("rising", moves > 0), ("falling", moves < 0)):
        low, high = np.minimum(path[:-1], path[1:])[chosen], np.maximum(path[:-1], path[1:])[chosen]
        first = np.clip(np.searchsorted(edges, low, side="right") - 1, 0, 99)
        last = np.clip(np.searchsorted(edges, high, side="left") - 1, 0, 99)
        begun, ended = np.bincount(first, minlength=101), np.bincount(np.maximum(last, first) + 1, minlength=101)
        share = float(np.mean(np.cumsum(begun - ended)[:100] > 0))
        if share < _LEAST_COVERAGE:
            what = f"less than one full loop: it covers only a part of the input span of {span:g}"
            value, limit = f"{100 * share:.0f} %", f"{100 * _LEAST_COVERAGE:.0f} %"
            cure = "record a full loop"
            raise IdentificationError(what, where=f"{name} input", value=value, limit=limit, cure=cure)


def _thin(
    path: FloatArray, y: FloatArray, corners: NDArray[np.bool_], cell: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    place = np.floor((path - path.min()) / cell).astype(np.int64)
    new = np.ones(len(path), dtype=bool)
    new[1:] = (place[1:] != place[:-1]) | corners[1:] | corners[:-1]
    group = np.cumsum(new) - 1
    count = np.bincount(group).astype(np.float64)
    return np.bincount(group, path) / count, np.bincount(group, y) / count, count
