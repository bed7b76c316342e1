"""The output of `smadrive campaign`: the estimate, the progress of the runs, the summary."""

from __future__ import annotations

import time
from collections import Counter
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.announcement import duration_text

if TYPE_CHECKING:
    from smadrive.campaigns.campaign import CampaignResult
    from smadrive.campaigns.execution.estimate import CampaignEstimate
    from smadrive.campaigns.experiments.run import RunResult
    from smadrive.campaigns.plan.plan import CampaignPlan

MOST_ROWS = 40
"""Largest number of rows of the summary in the terminal; the page has more."""


class CampaignView:
    """The progress bars of a campaign on stderr, if stderr is a terminal. A context manager.

    After the `with` block, `elapsed_s` is the duration of the block.
    """

    def __init__(self, count: int, done: int, output: Output) -> None:
        self._output, self._statuses = output, Counter[str]()
        console = Console(stderr=True)
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        is_hidden = output.quiet or not console.is_terminal
        self._progress = Progress(*columns, console=console, transient=True, disable=is_hidden)
        self._task = self._progress.add_task("runs", total=count, completed=done)

    def __enter__(self) -> Self:
        """Show the bar of the runs."""
        self._began_s = time.monotonic()
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the bars."""
        self._progress.stop()
        self.elapsed_s = time.monotonic() - self._began_s

    def finished(self, result: RunResult) -> None:
        """Count a finished run."""
        self._statuses[str(result.row.get("status", "done"))] += 1
        wrong = "".join(f", {self._statuses[name]} {name}" for name in ("tripped", "failed") if self._statuses[name])
        self._progress.update(self._task, advance=1, description=f"runs{wrong}")

    def begin(self, step: str, count: int) -> None:
        """Show a bar for a step after the runs, which has `count` parts. Without bars, print its name."""
        if self._progress.disable:
            self._output.say(step)
        self._task = self._progress.add_task(step, total=count)

    def advance(self) -> None:
        """Count a finished part of this step."""
        self._progress.advance(self._task)


def estimate_line(plan: CampaignPlan, done: int, estimate: CampaignEstimate, threads: int) -> str:
    """Return the line before the start: the number of runs, how many are `done`, and the estimated time and space."""
    before = f" ({done} are done)" if done else ""
    identifications = f", {estimate.identifications} identifications" if estimate.identifications else ""
    workers = f"{threads} worker{'s' if threads > 1 else ''}"
    takes = f"about {duration_text(estimate.core_s / threads)} on {workers}"
    return (
        f"{plan.config.title}: {plan.count} runs{before}{identifications}; {takes}, {estimate.disk_bytes / 1e6:.0f} MB"
    )


def print_summary(output: Output, plan: CampaignPlan, result: CampaignResult) -> None:
    """Print the summary, the warnings, and the files."""
    from smadrive.campaigns.experiments.columns import COLUMNS  # noqa: PLC0415
    from smadrive.campaigns.results.report import summary_cells, summary_header  # noqa: PLC0415
    from smadrive.campaigns.results.summary import summarized, summary_columns  # noqa: PLC0415

    by = summary_columns(plan)
    output.say(f"{plan.metric}: {COLUMNS[plan.metric].what}, in {COLUMNS[plan.metric].unit}")
    rows = summarized(result.table, plan.metric, by)
    output.table(summary_header(by), [summary_cells(row) for row in rows[:MOST_ROWS]])
    if len(rows) > MOST_ROWS:
        output.say(f"the table shows {MOST_ROWS} of {len(rows)} rows; the report shows the others")
    output.warn(_failures(result))
    output.warn(f"no log of run {number}: {reason}" for number, reason in result.logs.missing.items())
    output.say(f"report: {result.report_file}   logs of the worst runs: {len(result.logs.files)}")
    output.say(f"table: {result.table_file}   SHA-256 {result.digest}")


def _failures(result: CampaignResult) -> list[str]:
    """Return the warnings: how many runs failed, with the first error, and how many of them --resume repeats."""
    failed = result.table[result.table["status"] == "failed"]
    if failed.empty:
        return []
    first = failed.iloc[0]
    lines = [f"{len(failed)} of {len(result.table)} runs failed, the first is run {first['run']}: {first['error']}"]
    if result.not_final:
        lines.append(f"{result.not_final} of the failures say nothing about their runs; --resume repeats these runs")
    return lines


def result_object(plan: CampaignPlan, result: CampaignResult) -> dict[str, Any]:
    """Return the JSON object of a finished campaign."""
    from smadrive.campaigns.results.summary import summarized  # noqa: PLC0415

    (whole,) = summarized(result.table, plan.metric, ())
    return {
        "runs": whole.runs,
        "tripped": whole.tripped,
        "failed": whole.failed,
        "metric": plan.metric,
        "median": whole.median,
        "worst": whole.worst,
        "table_file": str(result.table_file),
        "sha256": result.digest,
        "report_file": str(result.report_file),
        "log_files": {str(number): str(path) for number, path in result.logs.files.items()},
        "missing_logs": {str(number): reason for number, reason in result.logs.missing.items()},
    }
