"""A campaign from its plan to its output folder.

campaign.toml      a copy of the campaign file            results.parquet   the table
journal.jsonl      finished runs, as they finish          effort.parquet    durations, times of day, processes
logs/run-N.h5      the worst runs, executed again         report.html       the page
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.execution.scheduling import Finished, naming_a_lost_scheduler, run_all
from smadrive.campaigns.experiments.references import typical_reference
from smadrive.campaigns.experiments.run import logged_run
from smadrive.campaigns.experiments.simulated_rig import check_disturbance
from smadrive.campaigns.plan.plan import CampaignPlan, PlannedRun
from smadrive.campaigns.results.report import write_campaign_report
from smadrive.campaigns.results.summary import check_report, worst_first
from smadrive.campaigns.results.table import EFFORT, RESULTS, effort_table, results_table, write_table
from smadrive.campaigns.versions import versions, with_versions
from smadrive.files.atomic import replacing

if TYPE_CHECKING:
    from distributed import Client
    from pandas import DataFrame

PAGE, LOGS = "report.html", "logs"

Step = Callable[[str], None]
"""A function that is called with the name of each step that follows the runs."""


class CampaignResult(NamedTuple):
    """A finished campaign: its table with file and digest, the page, and the logs of the worst runs by number.

    `not_final` is the number of failed runs that `--resume` repeats.
    """

    table: DataFrame
    table_file: Path
    digest: str
    report_file: Path
    logs: dict[int, Path]
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
    client: Client, plan: CampaignPlan, groups: list[list[int]], journal: Journal, finished: Finished, step: Step
) -> CampaignResult:
    """Execute the runs in `groups`, and write table, logs of the worst runs, and page into the folder of the journal.

    `finished` is called with each result, and `step` before each step after the runs.
    """
    run_all(client, plan, groups, journal, finished)
    table = results_table(plan, journal.results)
    table_file = journal.folder / RESULTS
    digest = write_table(table, table_file)
    write_table(effort_table(journal.results), journal.folder / EFFORT)
    step("logs of the worst runs")
    logs = write_worst_logs(client, plan, table, journal.folder / LOGS)
    step("report")
    write_campaign_report(journal.folder / PAGE, plan, table, digest, logs)
    return CampaignResult(table, table_file, digest, journal.folder / PAGE, logs, journal.not_final)


def write_worst_logs(client: Client, plan: CampaignPlan, table: DataFrame, folder: Path) -> dict[int, Path]:
    """Execute the worst tracking runs again, now with a log. Return the paths of the logs by the number of the run.

    A run depends on its settings alone, so its second execution equals the first one. Failed runs get no log. Without
    tracking, the result is empty.
    """
    ranked = worst_first(table[table["status"] != "failed"], plan.metric)
    numbers = [int(number) for number in ranked["run"].head(plan.config.report.worst_logs)]
    if plan.config.run.experiment != "track" or not numbers:
        return {}
    folder.mkdir(exist_ok=True)
    logs = {}
    for number, content in zip(numbers, _log_contents(client, [plan.run(one) for one in numbers]), strict=True):
        logs[number] = folder / f"run-{number}.h5"
        with replacing(logs[number]) as partial:
            partial.write_bytes(content)
    return logs


def _log_contents(client: Client, runs: list[PlannedRun]) -> list[bytes]:
    """Execute the runs with logs on the cluster. Return the content of each log."""
    with naming_a_lost_scheduler():
        futures = [client.submit(with_versions, versions(), logged_run, run, pure=False) for run in runs]
        contents: list[bytes] = client.gather(futures)
    return contents
