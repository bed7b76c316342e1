"""The dependence of the metric on the axes, and on the properties of random wires.

The metric is replaced by its rank R among the runs, so that a few very bad runs do not decide. For an axis with L
values, the corrected correlation ratio (epsilon squared) is the share of the variance of R between its values:

    eps² = 1 - (1 - eta²) (n - 1) / (n - L)         eta² = Σ n_l (mean R_l - mean R)² / Σ (R - mean R)²

n is the number of runs, n_l the number of runs with value l, and R_l their ranks. On a complete grid eta² is the
first-order Sobol index of R. The correction makes the expected share 0 for an axis without effect. A property of random
wires gets a part of the share of the wires:

    share = eps² of the wires · (1 - (1 - rho²) (m - 1) / (m - 2))

m is the number of wires, rho Spearman's correlation of the property with the mean rank of each wire. If each wire has
only one run, eps² of the wires counts as 1. Shares below 0 count as 0. Interactions belong to no share, so the shares
do not sum up to 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from smadrive.campaigns.experiments.columns import WIRE
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.numerics.arrays import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

FEWEST_RUNS = 8
"""Smallest number of runs for which shares are computed."""

FEWEST_WIRES = 12
"""Smallest number of random wires for which their properties get shares."""

WIRES = "wire.seed"
"""The path of the setting that makes a wire random."""


class ColumnShare(NamedTuple):
    """The share of the metric's rank variance that belongs to one column.

    For an axis, each value of the column has a median of the metric; `lowest` and `highest` are the extremes of these
    medians. For a property of random wires, `lowest` and `highest` are the medians of the metric over the fifth of the
    runs with the lowest, and with the highest values of the property.
    """

    column: str
    share: float
    lowest: float
    highest: float


def sensitivities(plan: CampaignPlan, table: DataFrame, metric: str) -> list[ColumnShare]:
    """Return the columns by their shares, the largest first. The list is empty for fewer than `FEWEST_RUNS` runs."""
    runs = table[np.isfinite(table[metric].to_numpy(dtype=np.float64))]
    if len(runs) < FEWEST_RUNS:
        return []
    found = list(_shares(plan, runs, runs[metric].to_numpy(dtype=np.float64)))
    return sorted(found, key=lambda one: one.share, reverse=True)


def _shares(plan: CampaignPlan, runs: DataFrame, metric: FloatArray) -> Iterator[ColumnShare]:
    for axis in plan.axes:
        codes = np.unique(runs[axis.name].to_numpy(), return_inverse=True)[1]
        if 1 < np.unique(codes).size < len(runs):
            yield _of_levels(axis.name, codes, metric)
        if WIRES in axis.settings[0]:
            yield from _of_properties(runs, codes, metric)


def _of_levels(name: str, codes: NDArray[np.intp], metric: FloatArray) -> ColumnShare:
    ranks, levels, n = scipy.stats.rankdata(metric), np.unique(codes), metric.size
    means, counts = _means(ranks, codes), np.bincount(codes)[levels]
    spread = float(np.sum((ranks - ranks.mean()) ** 2))
    eta2 = float(np.sum(counts * (means - ranks.mean()) ** 2)) / spread if spread else 0.0
    share = 1.0 - (1.0 - eta2) * (n - 1) / (n - levels.size)
    medians = [float(np.median(metric[codes == level])) for level in levels]
    return ColumnShare(name, max(share, 0.0), min(medians), max(medians))


def _of_properties(runs: DataFrame, codes: NDArray[np.intp], metric: FloatArray) -> Iterator[ColumnShare]:
    """Yield the shares of the properties that differ from wire to wire. `codes` are the wires of the runs."""
    first = np.unique(codes, return_index=True)[1]
    if first.size < FEWEST_WIRES:
        return
    wires = 1.0 if first.size == len(runs) else _of_levels(WIRES, codes, metric).share
    means = _means(scipy.stats.rankdata(metric), codes)
    for name in WIRE:
        values = runs[name].to_numpy() if name in runs else np.array([])
        if values.dtype == np.float64 and np.unique(values[first]).size == first.size:
            share = wires * _corrected_rho2(values[first], means)
            yield ColumnShare(name, share, *_medians_of_fifths(values, metric))


def _corrected_rho2(values: FloatArray, means: FloatArray) -> float:
    rho = float(np.corrcoef(scipy.stats.rankdata(values), scipy.stats.rankdata(means))[0, 1]) if np.ptp(means) else 0.0
    return max(1.0 - (1.0 - rho**2) * (values.size - 1) / (values.size - 2), 0.0)


def _medians_of_fifths(values: FloatArray, metric: FloatArray) -> tuple[float, float]:
    """Return the median of the metric in the lowest and in the highest fifth of the values."""
    fifth, by_value = max(values.size // 5, 1), metric[np.argsort(values, kind="stable")]
    return float(np.median(by_value[:fifth])), float(np.median(by_value[-fifth:]))


def _means(ranks: FloatArray, codes: NDArray[np.intp]) -> FloatArray:
    """Return the mean rank of each level, in the order of the levels."""
    return np.array([ranks[codes == level].mean() for level in np.unique(codes)])
