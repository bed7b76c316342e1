"""The order in which the runs of a campaign go to the cluster, and the collection of their results.

The runs of a group share one identification. They go to the cluster as soon as it is finished, so that no run in the
queue waits for an identification, and the cluster drops its result after the last of them. Identifications go to the
cluster ahead of the runs, so that all workers have work while some identify.

Per thread, only `RUNS_PER_THREAD` runs and `GROUPS_PER_THREAD` groups are on the cluster at a time. So the memory does
not grow with the campaign. The threads are counted again and again, because workers can join and leave.
"""

from __future__ import annotations

import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from math import inf
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple

from smadrive.campaigns.execution.cluster import OPTION
from smadrive.campaigns.execution.journal import Journal
from smadrive.campaigns.experiments.columns import outcome_row
from smadrive.campaigns.experiments.identification import WireKnowledge
from smadrive.campaigns.experiments.run import (
    Effort,
    RunFailure,
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

GROUPS_PER_THREAD = 2
"""Number of groups per thread that are identified, or are identified already and have runs that are not yet sent."""

COUNTED_S = 1.0
"""Shortest time between two counts of the threads, s."""


def groups_of(plan: CampaignPlan, done: set[int]) -> list[list[int]]:
    """Return the numbers of the runs that are not done, in groups. The runs of a group share one identification."""
    groups: dict[str, list[int]] = {}
    for number in range(plan.count):
        if number not in done:
            run = plan.run(number)
            key = identification_key(run) if needs_identification(run) else f"run {number}"
            groups.setdefault(key, []).append(number)
    return list(groups.values())


def run_all(
    client: Client,
    plan: CampaignPlan,
    groups: list[list[int]],
    journal: Journal,
    finished: Callable[[RunResult], None],
) -> None:
    """Execute the runs of `groups` on the cluster, and add each result to the journal.

    `finished` is called with each result. TransportError if the scheduler is lost.
    """
    with naming_a_lost_scheduler():
        for number, result in _RunQueue(client, plan, groups).results():
            journal.add(number, result)
            finished(result)


class _Group(NamedTuple):
    """Runs that share an identification: the numbers that are not yet sent, and the identification if they need it."""

    left: deque[int]
    knowledge: Future[WireKnowledge | RunFailure] | None


class _RunQueue:
    """The runs and identifications that are on the cluster, and the groups that follow."""

    def __init__(self, client: Client, plan: CampaignPlan, groups: list[list[int]]) -> None:
        self._client, self._plan, self._following = client, plan, iter(groups)
        self._token = uuid.uuid4().hex[:8]
        self._running: dict[Any, tuple[int, Future[RunResult]]] = {}  # a future without a reference is cancelled
        self._identifying: dict[Any, _Group] = {}
        self._ready = deque[_Group]()
        self._finished = SimpleQueue[Any]()
        self._threads, self._counted_s = 1, -inf

    def results(self) -> Iterator[tuple[int, RunResult]]:
        """Yield the number and the result of each run, as it finishes."""
        self._fill()
        while self._running or self._identifying:
            try:
                future = self._finished.get(timeout=COUNTED_S)
            except Empty:  # all workers have work; other ones may have joined
                self._fill()
                continue
            if future.status == "cancelled":
                raise _lost_scheduler()
            if future.key in self._identifying:
                self._ready.append(self._identifying.pop(future.key))
            else:
                number, _ = self._running.pop(future.key)
                yield number, _result_of(future)
            self._fill()

    def _fill(self) -> None:
        """Send identifications and runs until the cluster has as many as its threads may have."""
        self._count_threads()
        while self._begin_group() or self._send_run():
            pass

    def _count_threads(self) -> None:
        """Count the threads of the workers that are there now. TransportError if the scheduler is lost."""
        if time.monotonic() - self._counted_s < COUNTED_S:
            return
        try:
            self._threads = max(1, sum(self._client.nthreads().values()))
        except OSError:
            raise _lost_scheduler() from None
        self._counted_s = time.monotonic()

    def _begin_group(self) -> bool:
        """Identify the wire of the next group, if it needs that. Return False if there is no room, or no group."""
        begun = len(self._identifying) + len(self._ready)
        if begun >= GROUPS_PER_THREAD * self._threads or (numbers := next(self._following, None)) is None:
            return False
        first = self._plan.run(numbers[0])
        if needs_identification(first):
            key = f"{identification_key(first)}-{self._token}"
            self._identifying[key] = _Group(deque(numbers), self._submit(key, identify, first))
        else:
            self._ready.append(_Group(deque(numbers), None))
        return True

    def _send_run(self) -> bool:
        """Send the next run of a group that is ready. Return False if there is no room, or no such group."""
        if len(self._running) >= RUNS_PER_THREAD * self._threads or not self._ready:
            return False
        group = self._ready[0]
        number = group.left.popleft()
        key = f"run-{number}-{self._token}"
        self._running[key] = number, self._submit(key, execute, self._plan.run(number), group.knowledge)
        if not group.left:
            self._ready.popleft()  # the cluster keeps the identification until the last of its runs has ended
        return True

    def _submit(self, key: str, task: Callable[..., Any], *arguments: object) -> Future[Any]:
        future = self._client.submit(with_versions, versions(), task, *arguments, key=key)
        future.add_done_callback(self._finished.put)
        return future


@contextmanager
def naming_a_lost_scheduler() -> Iterator[None]:
    """Raise TransportError, with the cure, in place of every error of Dask for a scheduler that has ended."""
    from distributed.client import ClosedClientError  # noqa: PLC0415 (a command that needs no cluster must start at once)
    from distributed.comm.core import CommClosedError  # noqa: PLC0415

    try:
        yield
    except (CancelledError, ClosedClientError, CommClosedError):
        raise _lost_scheduler() from None


def _lost_scheduler() -> TransportError:
    cure = "start the cluster again, and go on with --resume"
    return TransportError("the scheduler is lost", where=OPTION, cure=cure)


def _result_of(future: Future[RunResult]) -> RunResult:
    """Return the result of a run. An error that Dask reports in its place is a failure that is not final.

    If the worker has died with the result, wait until another worker has repeated the run.
    """
    try:
        return future.result()
    except Exception as error:
        if future.status != "error":  # the scheduler is lost
            raise
        effort = Effort("", 0.0, 0.0, 0.0, "", str(error))
        return RunResult(outcome_row("failed", error, error_text(error)), effort, is_final=False)


def error_text(error: Exception) -> str:
    """Return the text of an error that Dask reports in place of the result of a run."""
    from distributed.scheduler import KilledWorker  # noqa: PLC0415 (a command that needs no cluster must start at once)

    return "the workers that executed this run died" if isinstance(error, KilledWorker) else str(error)
