"""The order in which the runs of a campaign go to the cluster, and the collection of their results.

Runs that share an identification follow each other. The cluster identifies their wire once, and drops the result after
the last of these runs. Only `RUNS_PER_THREAD` runs per thread are on the cluster at a time, so the memory does not grow
with the campaign.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from smadrive.campaigns.execution.cluster import OPTION
from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.experiments.columns import outcome_row
from smadrive.campaigns.experiments.run import (
    Effort,
    RunResult,
    execute,
    identification_key,
    identify,
    needs_identification,
)
from smadrive.campaigns.plan.plan import CampaignPlan
from smadrive.campaigns.versions import versions, with_versions
from smadrive.errors import TransportError

if TYPE_CHECKING:
    from distributed import Client, Future

RUNS_PER_THREAD = 4
"""Number of runs per thread that are on the cluster at a time: enough that no worker waits for its next run."""

Finished = Callable[[RunResult], None]


def groups_of(plan: CampaignPlan, done: set[int]) -> list[list[int]]:
    """Return the numbers of the runs that are not done, in groups. The runs of a group share one identification."""
    groups: dict[str, list[int]] = {}
    for number in range(plan.count):
        if number not in done:
            run = plan.run(number)
            key = identification_key(run) if needs_identification(run) else f"run {number}"
            groups.setdefault(key, []).append(number)
    return list(groups.values())


def run_all(client: Client, plan: CampaignPlan, groups: list[list[int]], journal: Journal, finished: Finished) -> None:
    """Execute the runs of `groups` on the cluster, and add each result to the journal.

    `finished` is called with each result. TransportError if the scheduler is lost.
    """
    from distributed import as_completed  # noqa: PLC0415 (a command that needs no cluster must start at once)

    submissions = _submissions(client, plan, groups)
    numbers: dict[Any, int] = {}

    def submitted(count: int) -> list[Future[RunResult]]:
        futures = []
        for number, future in submissions:
            numbers[future.key] = number
            futures.append(future)
            if len(futures) == count:
                break
        return futures

    with naming_a_lost_scheduler():
        threads = max(1, sum(client.nthreads().values()))
        completed = as_completed(submitted(RUNS_PER_THREAD * threads))
        for future in completed:
            number, result = numbers.pop(future.key), _result_of(future)
            journal.add(number, result)
            finished(result)
            for following in submitted(1):
                completed.add(following)


def _submissions(
    client: Client, plan: CampaignPlan, groups: list[list[int]]
) -> Iterator[tuple[int, Future[RunResult]]]:
    """Yield the number and the future of each run. A run is sent to the cluster when the caller asks for it."""
    token = uuid.uuid4().hex[:8]
    for group in groups:
        first = plan.run(group[0])
        knowledge = None
        if needs_identification(first):
            key = f"{identification_key(first)}-{token}"
            knowledge = client.submit(with_versions, versions(), identify, first, key=key)
        for number in group:
            run, key = plan.run(number), f"run-{number}-{token}"
            yield number, client.submit(with_versions, versions(), execute, run, knowledge, key=key)


@contextmanager
def naming_a_lost_scheduler() -> Iterator[None]:
    """Raise TransportError, with the cure, in place of every error of Dask for a scheduler that has ended."""
    from distributed.client import ClosedClientError  # noqa: PLC0415 (a command that needs no cluster must start at once)
    from distributed.comm.core import CommClosedError  # noqa: PLC0415

    try:
        yield
    except (CancelledError, ClosedClientError, CommClosedError):
        cure = "start the cluster again, and go on with --resume"
        raise TransportError("the scheduler is lost", where=OPTION, cure=cure) from None


def _result_of(future: Future[RunResult]) -> RunResult:
    """Return the result of a run. An error that Dask reports in its place is a failure that is not final."""
    if future.status in ("cancelled", "lost"):
        raise CancelledError
    error: Any = future.exception() if future.status == "error" else None
    if error is None:
        return future.result()
    effort = Effort("", 0.0, 0.0, 0.0, "", str(error))
    return RunResult(outcome_row("failed", error, error_text(error)), effort, is_final=False)


def error_text(error: Exception) -> str:
    """Return the text of an error that Dask reports in place of the result of a run."""
    from distributed.scheduler import KilledWorker  # noqa: PLC0415 (a command that needs no cluster must start at once)

    return "the workers that executed this run died" if isinstance(error, KilledWorker) else str(error)
