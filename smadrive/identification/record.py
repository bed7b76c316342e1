"""Preparation of a measured record for a fit: false reversals are removed, the loop is checked, samples are averaged.

The models are rate-independent, and a step of any length is exact. So each monotone section of the path is divided into
cells of 1/150 of the input span. The mean of the samples in a cell replaces these samples, and their number is the
weight of the mean. Turning points stay unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis.reversal import check_radius, monotone_runs
from smadrive.numerics.arrays import FloatArray, paired_vectors
from smadrive.numerics.residuals import noise_deviation

_CELLS = 150  # number of cells over the input span; the samples of a cell are averaged
FEWEST_SAMPLES = 3
"""The input of a loop rises and falls, so a record has at least this number of samples."""

_NOISE_BAND = 4.0  # radius of the dead band, in standard deviations of the input noise
_WIDEST_BAND = 0.025  # largest radius, share of the input span: coarse sampling must not count as noise
_LEAST_COVERAGE = 0.6  # share of the input span that the record covers in each direction


if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from smadrive.hysteresis import HysteresisModel


@dataclass(frozen=True, slots=True)
class Record:
    """A prepared record: all samples, and the means of the cells.

    path                input without false reversals, (samples,)
    y                   output, (samples,)
    corners             True at samples where the path starts, turns or ends, (samples,)
    v, mean_y, count    mean input, mean output and number of samples of each cell, (cells,)
    input_range         lowest and highest input
    output_span         highest - lowest output
    noise               standard deviation of the output noise, as a share of `output_span`
    scatter             sum of squares of y about the means of the cells, divided by `output_span` squared
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
        """True for each cell that was reached by rising input. The first cell has the direction of the second cell."""
        moves = self.v[1:] > self.v[:-1]
        return np.concatenate([moves[:1], moves])

    def misfit(self, model: HysteresisModel, y0: float) -> float:
        """Return the RMS error of `model` against the means of the cells, as a share of the output span.

        The simulation starts at the output `y0`. The scatter within the cells does not count: no model explains the
        scatter, and it would hide small differences between models.
        """
        error = (model.simulate(self.v, y0) - self.mean_y) / self.output_span
        return float(np.sqrt(self.count @ error**2 / self.count.sum()))


def prepare(v: ArrayLike, y: ArrayLike, dead_band: float | None) -> Record:
    """Check a record, remove its false reversals, average its samples in cells, and return the prepared record.

    v and y are input and output, both (samples,). `dead_band` is the radius of the reversal filter in the unit of v; if
    it is None, the radius follows from the noise of v. Raises DataError for samples that cannot be used,
    IdentificationError for a record without a full loop.
    """
    inputs, outputs = paired_vectors(v, y)
    if len(inputs) < FEWEST_SAMPLES:
        cure = "record at least one full loop"
        raise IdentificationError("too few samples", where="record", value=len(inputs), limit=FEWEST_SAMPLES, cure=cure)
    span, output_span = float(np.ptp(inputs)), float(np.ptp(outputs))
    if span == 0:
        raise IdentificationError("is constant", where="input", value=inputs[0], cure="record at least one full loop")
    if output_span == 0:
        cure = "check the sensor and record a full loop"
        raise IdentificationError("is constant", where="output", value=outputs[0], cure=cure)
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
    """Raise IdentificationError unless the input rises and falls over most of its span."""
    moves = np.diff(path)
    edges = np.linspace(path.min(), path.max(), 101)
    for name, chosen in (("rising", moves > 0), ("falling", moves < 0)):
        low, high = np.minimum(path[:-1], path[1:])[chosen], np.maximum(path[:-1], path[1:])[chosen]
        first = np.clip(np.searchsorted(edges, low, side="right") - 1, 0, 99)
        last = np.clip(np.searchsorted(edges, high, side="left") - 1, 0, 99)
        begun, ended = np.bincount(first, minlength=101), np.bincount(np.maximum(last, first) + 1, minlength=101)
        share = float(np.mean(np.cumsum(begun - ended)[:100] > 0))
        if share < _LEAST_COVERAGE:
            what = f"less than one full loop, because it covers too small a part of the input span of {span:g}"
            value, limit = f"{100 * share:.0f} %", f"{100 * _LEAST_COVERAGE:.0f} %"
            cure = "record a full loop, or choose the column of the temperature as the input"
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
