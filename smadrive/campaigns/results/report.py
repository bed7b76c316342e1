"""The page of a campaign: end, distributions, summary, sensitivity, worst runs with plots of their logs, provenance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from smadrive.campaigns.experiments.columns import labelled
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.results.figures import axis_plots, distribution_plot, sensitivity_plot
from smadrive.campaigns.results.sensitivity import ColumnShare, sensitivities
from smadrive.campaigns.results.summary import (
    SummaryRow,
    level_text,
    number_text,
    summarized,
    summary_columns,
    worst_first,
)
from smadrive.campaigns.results.table import RESULTS
from smadrive.runs.figures.log_plots import log_plots
from smadrive.runs.log.reader import read_log
from smadrive.runs.report import Banner, Grid, Listing, Notes, PagePart, Plot, Tiles, write_report

if TYPE_CHECKING:
    from pandas import DataFrame

MOST_ROWS = 200
"""Largest number of rows of each table on the page: the summary, and the errors."""

LOG_PLOTS = 2
"""Each worst run is shown with this number of plots: tracking and heat."""

TRUE_ERRORS = ("rms_percent", "max_percent")
"""The metrics that are errors of the true displacement."""


def write_campaign_report(
    path: Path, plan: CampaignPlan, table: DataFrame, digest: str, logs: Mapping[int, Path]
) -> None:
    """Write the page. `digest` is the SHA-256 of the table, and `logs` are the logs of the worst runs by number."""
    metric, by = plan.metric, summary_columns(plan)
    ranking, has_values = sensitivities(plan, table, metric), bool(table[metric].notna().any())
    parts: list[PagePart] = [
        _end(plan, table),
        Tiles(_tiles(table, metric)),
        *([distribution_plot(table, metric)] if has_values else []),
        summary_grid(by, metric, summarized(table, metric, by)),
        *(axis_plots(plan, table, metric) if has_values else ()),
        *_two_axes(plan, table, metric),
        *_ranking(ranking, metric),
        *_worst(plan, table, metric, logs),
        *_errors(table),
        Grid(("", ""), _provenance(plan, digest), "Provenance", texts=True),
        Listing("Campaign file", plan.text),
    ]
    write_report(path, plan.config.title, f"{plan.count} runs · metric {metric}", parts)


def summary_header(by: Sequence[str]) -> tuple[str, ...]:
    """Return the header of the summary."""
    return (*by, "runs", "median", "90 %", "worst", "tripped", "failed")


def summary_cells(row: SummaryRow) -> tuple[str, ...]:
    """Return the cells of a row of the summary."""
    numbers = (number_text(value) for value in (row.median, row.high, row.worst))
    return (*row.levels, str(row.runs), *numbers, str(row.tripped), str(row.failed))


def summary_grid(by: Sequence[str], metric: str, rows: Sequence[SummaryRow]) -> Grid:
    """Return the table of medians and worst values."""
    part = "" if len(rows) <= MOST_ROWS else f", the first {MOST_ROWS} of {len(rows)} rows"
    title = f"Summary of {labelled(metric)}{part}"
    return Grid(summary_header(by), [summary_cells(row) for row in rows[:MOST_ROWS]], title)


def _end(plan: CampaignPlan, table: DataFrame) -> Banner:
    counts = table["status"].value_counts()
    tripped, failed = int(counts.get("tripped", 0)), int(counts.get("failed", 0))
    if tripped or failed:
        return Banner("warning", f"Complete: {plan.count} runs, of which {tripped} tripped and {failed} failed.")
    return Banner("good", f"Complete: {plan.count} runs, without a trip or a failure.")


def _tiles(table: DataFrame, metric: str) -> list[tuple[str, str]]:
    (all_runs,) = summarized(table, metric, ())
    return [
        (number_text(all_runs.median), f"median of {labelled(metric)}"),
        (number_text(all_runs.high), "90 % of the runs that have a value are below"),
        (number_text(all_runs.worst), "worst"),
        (f"{all_runs.tripped} / {all_runs.failed}", "tripped / failed"),
    ]


def _two_axes(plan: CampaignPlan, table: DataFrame, metric: str) -> Iterator[Grid]:
    """Yield the table of medians over the first two axes, random wires and repeats excepted.

    A value of an axis is in the table even if all its runs failed.
    """
    compared = [axis for axis in plan.axes if not axis.is_sample and len(axis.levels) > 1]
    if len(compared) < 2:
        return
    down, across = compared[:2]
    medians = table.pivot_table(
        index=down.name, columns=across.name, values=metric, aggfunc="median", sort=False, dropna=False
    )
    rows = [
        (level_text(level), *(number_text(float(value)) for value in row))
        for level, row in zip(medians.index, medians.to_numpy(), strict=True)
    ]
    header = (f"{down.name} \\ {across.name}", *map(level_text, medians.columns))
    yield Grid(header, rows, f"Median of {labelled(metric)}: {down.name} and {across.name}")


def _ranking(ranking: Sequence[ColumnShare], metric: str) -> Iterator[PagePart]:
    if not ranking:
        yield Notes(["The campaign has too few runs, or too few values, for a ranking of its axes."])
        return
    yield sensitivity_plot(ranking, metric)
    rows = [
        (one.column, f"{100 * one.share:.1f} %", number_text(one.lowest), number_text(one.highest)) for one in ranking
    ]
    yield Grid(("column", "share", f"median {labelled(metric)}, from", "to"), rows)


def _worst(plan: CampaignPlan, table: DataFrame, metric: str, logs: Mapping[int, Path]) -> Iterator[PagePart]:
    axes = [axis.name for axis in plan.axes]
    scored = table[table["status"] != "failed"]
    worst = worst_first(scored, metric).head(max(plan.config.report.worst_logs, 1))
    rows = [
        (str(row["run"]), *(level_text(row[name]) for name in axes), number_text(row[metric]), row["status"])
        for _, row in worst.iterrows()
    ]
    yield Grid(("run", *axes, labelled(metric), "status"), rows, "Worst runs")
    if logs:
        of_truth = " The errors in the table are those of the true displacement." if metric in TRUE_ERRORS else ""
        yield Notes([f"The plots show the measured and the estimated values of each run.{of_truth}"])
    for number, path in logs.items():
        for plot in islice(log_plots(read_log(path)), LOG_PLOTS):
            yield Plot(f"Run {number}: {plot.title.lower()}", plot.figure, f"{path.name}. {plot.caption}")


def _errors(table: DataFrame) -> Iterator[Grid]:
    """Yield the table of errors of tripped and failed runs: for each error, the number of runs and the first run."""
    wrong = table[table["status"] != "done"]
    if wrong.empty:
        return
    grouped = wrong.groupby(["status", "error_type", "error"], sort=False)["run"].agg(["count", "min"]).reset_index()
    ranked = grouped.sort_values("count", ascending=False, kind="stable").head(MOST_ROWS)
    rows = [
        (row["status"], str(row["count"]), str(row["min"]), f"{row['error_type']}: {row['error']}")
        for _, row in ranked.iterrows()
    ]
    yield Grid(("status", "runs", "first run", "error"), rows, "Trips and failures", texts=True)


def _provenance(plan: CampaignPlan, digest: str) -> list[tuple[str, str]]:
    return [
        ("table", f"{RESULTS}, SHA-256 {digest}"),
        ("campaign file", f"{plan.path.name}, fingerprint {plan.fingerprint}"),
        ("seed", str(plan.config.seed)),
    ]
