"""Median and worst of a metric for each combination of values, and the worst runs.

A run that tripped or failed has no tracking error. The summary counts these runs in columns of their own, and they rank
as worse than every other run, whatever the metric. Other metrics of a run that tripped are those up to the trip: they
count like those of any run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smadrive.campaigns.experiments.columns import COLUMNS, columns_of
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list

if TYPE_CHECKING:
    from pandas import DataFrame


class SummaryRow(NamedTuple):
    """The runs with one combination of values: median, 90 % quantile and largest value of the metric, and counts."""

    levels: tuple[str, ...]
    runs: int
    median: float
    high: float
    worst: float
    tripped: int
    failed: int


def check_report(plan: CampaignPlan) -> None:
    """Raise ConfigError for an axis with the name of a column, and for columns in [report] that no run can have."""
    names = [axis.name for axis in plan.axes]
    for name in names:
        if name in COLUMNS or name == "run":
            cure = 'write another name = "…" at this axis'
            raise ConfigError("an axis has the name of a metric", where="[[vary]]", value=name, cure=cure)
    settings = plan.run(0).settings  # all runs have a model, or none
    columns = columns_of(settings.experiment, has_model=settings.model is not None)
    numbers = [name for name, column in columns.items() if column.kind is float]
    for key, given, allowed in (
        ("metric", (plan.metric,), numbers),
        ("by", plan.config.report.by or (), [*names, *columns]),
    ):
        for name in given:
            if name not in allowed:
                is_impossible = name in COLUMNS and name not in columns
                what = "no run of this campaign has this column" if is_impossible else "no such column"
                cure = suggestion_or_list(name, allowed)
                raise ConfigError(what, where=f"[report] {key}", value=name, cure=cure)


def summary_columns(plan: CampaignPlan) -> list[str]:
    """Return the columns whose values make the rows of the summary."""
    if plan.config.report.by is not None:
        return list(plan.config.report.by)
    return [axis.name for axis in plan.axes if not axis.is_sample]


def summarized(table: DataFrame, metric: str, by: Sequence[str]) -> list[SummaryRow]:
    """Return a row for each combination of the values in the columns `by`, in the order of the runs."""
    if not by:
        return [_summary_row((), table, metric)]
    grouped = table.groupby(list(by), sort=False, dropna=False)
    return [_summary_row(tuple(map(level_text, values)), group, metric) for values, group in grouped]


def worst_first(table: DataFrame, metric: str) -> DataFrame:
    """Return the runs in the order of their metric, the worst first: trips, then failures, then the largest values."""
    rank = table["status"].map({"tripped": 2, "failed": 1}).fillna(0).to_numpy(dtype=np.float64)
    values = table[metric].to_numpy(dtype=np.float64)
    return table.iloc[np.lexsort((table["run"], -values, -rank))]  # NaN comes last


def level_text(value: object) -> str:
    """Return a value of an axis as text. Different values have different texts."""
    return str(value).removesuffix(".0") if isinstance(value, float) else str(value)


def number_text(value: float) -> str:
    """Return a value of a metric as text, with four digits."""
    return f"{value:.4g}"


def _summary_row(values: tuple[str, ...], runs: DataFrame, metric: str) -> SummaryRow:
    numbers = runs[metric].to_numpy(dtype=np.float64)
    numbers = numbers[np.isfinite(numbers)]
    median, high, worst = map(float, np.quantile(numbers, (0.5, 0.9, 1.0)) if numbers.size else np.full(3, np.nan))
    counts = runs["status"].value_counts()
    tripped, failed = int(counts.get("tripped", 0)), int(counts.get("failed", 0))
    return SummaryRow(values, len(runs), median, high, worst, tripped, failed)
