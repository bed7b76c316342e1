"""Which settings and which properties of the wire the metric depends on.

The metric is replaced by its rank R among the runs, so that a few very bad runs do not decide. For an axis with L
values, the corrected correlation ratio (epsilon squared) is the share of the variance of R between its values:

    eps² = 1 - (1 - eta²) (n - 1) / (n - L)         eta² = Σ n_l (mean R_l - mean R)² / Σ (R - mean R)²

n is the number of runs, n_l and R_l those with value l. On a complete grid eta² is the first-order Sobol index of R.
The correction makes the expected share 0 for an axis without effect. For a continuous property of a random wire the
share is the corrected square of Spearman's correlation, 1 - (1 - rho²) (n - 1) / (n - 2). Shares below 0 count as 0.
Interactions belong to no share, so the shares do not sum up to 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from smadrive.campaigns.experiments.columns import WIRE
from smadrive.campaigns.plan.plan import CampaignPlan

if TYPE_CHECKING:
    from pandas import DataFrame

Array = NDArray[np.float64]

FEWEST_RUNS = 8
"""With fewer runs a share says nothing."""

MANY = 12
"""A property of the wire with more values than this is continuous."""


class ColumnShare(NamedTuple):
    """The share of the metric's rank variance that belongs to one column.

    `lowest` and `highest` are the medians of the metric at the best and at the worst value of the column; of a
    continuous column, in its lowest and in its highest fifth.
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


def _shares(plan: CampaignPlan, runs: DataFrame, metric: Array) -> Iterator[ColumnShare]:
    for axis in plan.axes:
        codes = np.unique(runs[axis.name].to_numpy(), return_inverse=True)[1]
        if 1 < np.unique(codes).size < len(runs):
            yield _of_levels(axis.name, codes, metric)
    for name in WIRE:
        if name not in runs:
            continue
        values = runs[name].to_numpy()
        distinct, codes = np.unique(values, return_inverse=True)
        if distinct.size > MANY and values.dtype == np.float64:
            yield _of_numbers(name, values, metric)
        elif 1 < distinct.size < len(runs):
            yield _of_levels(name, codes, metric)


def _of_levels(name: str, codes: NDArray[np.intp], metric: Array) -> ColumnShare:
    ranks, levels, n = rankdata(metric), np.unique(codes), metric.size
    means = np.array([ranks[codes == level].mean() for level in levels])
    counts = np.array([np.count_nonzero(codes == level) for level in levels])
    spread = float(np.sum((ranks - ranks.mean()) ** 2))
    eta2 = float(np.sum(counts * (means - ranks.mean()) ** 2)) / spread if spread else 0.0
    share = 1.0 - (1.0 - eta2) * (n - 1) / (n - levels.size)
    medians = [float(np.median(metric[codes == level])) for level in levels]
    return ColumnShare(name, max(share, 0.0), min(medians), max(medians))


def _of_numbers(name: str, values: Array, metric: Array) -> ColumnShare:
    n, ranks, order = metric.size, rankdata(metric), rankdata(values)
    rho = float(np.corrcoef(ranks, order)[0, 1]) if np.ptp(ranks) else 0.0
    share = 1.0 - (1.0 - rho**2) * (n - 1) / (n - 2)
    fifth = max(n // 5, 1)
    by_value = metric[np.argsort(values, kind="stable")]
    return ColumnShare(name, max(share, 0.0), float(np.median(by_value[:fifth])), float(np.median(by_value[-fifth:])))
