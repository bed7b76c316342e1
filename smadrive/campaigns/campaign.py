"""A campaign from its plan to its output folder.

campaign.toml      a copy of the campaign file            results.parquet   the table
journal.jsonl      finished runs, as they finish          effort.parquet    durations, times of day, processes
logs/run-N.h5      the worst runs, executed again         report.html       the page
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.execution.scheduling import error_text, naming_a_lost_scheduler, run_all
from smadrive.campaigns.experiments.references import typical_reference
from smadrive.campaigns.experiments.run import RunResult, logged_run
from smadrive.campaigns.experiments.simulated_rig import check_disturbance
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.results.report import write_campaign_report
from smadrive.campaigns.results.summary import check_report, worst_first
from smadrive.campaigns.results.table import EFFORT, RESULTS, effort_table, results_table, write_table
from smadrive.campaigns.versions import versions, with_versions
from smadrive.errors import DataError, TransportError
from smadrive.files.atomic import replacing

if TYPE_CHECKING:
    from distributed import Client, Future
    from pandas import DataFrame

PAGE, LOGS = "report.html", "logs"


class CampaignProgress(Protocol):
    """Shows the progress of a campaign."""

    def finished(self, result: RunResult) -> None:
        """Report a finished run."""

    def begin(self, step: str, count: int) -> None:
        """Report that a step begins, which follows the runs and has `count` parts."""

    def advance(self) -> None:
        """Report that a part of this step is finished."""


class WorstLogs(NamedTuple):
    """The logs of the worst runs by number, the worst run first, and the reasons for missing ones."""

    files: dict[int, Path]
    missing: dict[int, str]


class CampaignResult(NamedTuple):
    """A finished campaign: its table with file and digest, the page, and the logs of the worst runs.

    `not_final` is the number of failed runs that `--resume` repeats.
    """

    table: DataFrame
    table_file: Path
    digest: str
    report_file: Path
    logs: WorstLogs
    not_final: int


def check_plan(plan: CampaignPlan) -> None:
    """Raise ConfigError if the settings of a run are wrong, a file is missing, or a fault or column is unknown.

    Of the references, only what does not depend on the wire is checked.
    """
    check_report(plan)
    checked = set[tuple[str | None, str]]()
    for run in plan.sample():
        names = run.settings.reference, run.settings.disturbance
        if run.reference is not None and names not in checked:
            check_disturbance(run, typical_reference(run.reference))
            checked.add(names)
    plan.check_files()


def conduct(
    client: Client, plan: CampaignPlan, groups: list[list[int]], journal: Journal, progress: CampaignProgress
) -> CampaignResult:
    """Execute the runs in `groups`, and write table, worst logs and page into the folder of the journal."""
    run_all(client, plan, groups, journal, progress.finished)
    table = results_table(plan, journal.results)
    table_file = journal.folder / RESULTS
    digest = write_table(table, table_file)
    write_table(effort_table(journal.results), journal.folder / EFFORT)
    numbers = worst_numbers(plan, table)
    if numbers:
        progress.begin("logs of the worst runs", len(numbers))
    logs = write_worst_logs(client, plan, numbers, journal.folder / LOGS, progress.advance)
    progress.begin("report", 1)
    write_campaign_report(journal.folder / PAGE, plan, table, digest, logs.files)
    return CampaignResult(table, table_file, digest, journal.folder / PAGE, logs, journal.not_final)


def write_worst_logs(
    client: Client, plan: CampaignPlan, numbers: list[int], folder: Path, finished: Callable[[], None]
) -> WorstLogs:
    """Execute the runs `numbers` again, now with a log, and remove the logs of an earlier command.

    A run depends on its settings alone, so its second execution equals the first one. An error is no error of the
    campaign, whose table is complete: it is the reason for a missing log. `finished` is called after each run.
    """
    reasons: dict[int, str] = {}
    try:
        _prepare(folder, bool(numbers))
        with naming_a_lost_scheduler():
            for number, future in _logged(client, plan, numbers):
                reasons[number] = _written(future, _log_file(folder, number))
                finished()
    except (DataError, TransportError) as error:
        reasons = {number: reasons.get(number, str(error)) for number in numbers}
    files = {number: _log_file(folder, number) for number in numbers if not reasons[number]}
    return WorstLogs(files, {number: reason for number, reason in reasons.items() if reason})


def worst_numbers(plan: CampaignPlan, table: DataFrame) -> list[int]:
    """Return the numbers of the runs that get a log, the worst first: no failed run, and none without tracking."""
    if plan.config.run.experiment != "track":
        return []
    ranked = worst_first(table[table["status"] != "failed"], plan.metric)
    return [int(number) for number in ranked["run"].head(plan.config.report.worst_logs)]


def _log_file(folder: Path, number: int) -> Path:
    return folder / f"run-{number}.h5"


def _prepare(folder: Path, is_needed: bool) -> None:
    """Remove the logs of an earlier command, and create the folder if it is needed. DataError if that fails."""
    try:
        for old in folder.glob("run-*.h5"):
            old.unlink()
        if is_needed:
            folder.mkdir(exist_ok=True)
    except OSError as error:
        cure = "check the folder, and go on with --resume"
        raise DataError("cannot be used for logs", where=folder, value=error.strerror, cure=cure) from None


def _logged(client: Client, plan: CampaignPlan, numbers: list[int]) -> Iterator[tuple[int, Future[bytes]]]:
    """Execute the runs with logs on the cluster. Yield the number of each run, and its log as soon as it is there.

    No log is kept, so the memory does not grow with the number of logs.
    """
    from distributed import as_completed  # noqa: PLC0415 (a command that needs no cluster must start at once)

    futures = [client.submit(with_versions, versions(), logged_run, plan.run(number), pure=False) for number in numbers]
    by_key = {future.key: number for number, future in zip(numbers, futures, strict=True)}
    completed = as_completed(futures, loop=client.loop)
    del futures
    for future in completed:
        yield by_key[future.key], future


def _written(future: Future[bytes], log_file: Path) -> str:
    """Write a log to its file. Return an empty text or, if there is no log, the reason."""
    if future.status in ("cancelled", "lost"):
        raise CancelledError
    if future.status == "error":
        return error_text(future.exception())
    try:
        with replacing(log_file) as partial:
            partial.write_bytes(future.result())
    except DataError as error:
        return str(error)
    return ""
