"""The queue of changes. The model builder builds and checks a change; then it is put in force between two ticks.

One job is built at a time, and each job starts from the result of the previous one. While a slider is dragged, only its
latest value waits. A change that is refused leaves the tuning in force as it is, and the reason is reported.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from smadrive.control.controllers.swappable import SwappableController
from smadrive.errors import ConfigError, SmadriveError
from smadrive.identification.adaptation.adaptation import Adaptation
from smadrive.rig.config import RigConfig
from smadrive.tuning.builder.build import BuildFailure, BuildRequest, BuildResult, ModelBuilder
from smadrive.tuning.link.requests import AnyRequest, Compare, Keep, SetValue
from smadrive.tuning.session.changes.comparison_runner import ComparisonRunner
from smadrive.tuning.session.changes.jobs import ChangeJob, Job, ReferenceLookup, job_of
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.tuning import Adapted
from smadrive.wire.wire_properties import WireProperties

MAX_WAITING = 8

Answer = tuple[AnyRequest, str | None]
"""A request, and the reason why it is refused, which is None when the request is done."""


class ChangeQueue:
    """The jobs that wait, and the job that is being built. `path` returns a reference (see jobs.ReferenceLookup)."""

    def __init__(
        self, tunings: Tunings, builder: ModelBuilder, path: ReferenceLookup, config: RigConfig, wire: WireProperties
    ) -> None:
        self._tunings = tunings
        self._builder = builder
        self._path = path
        self._config = config
        self._wire = wire
        self.comparison = ComparisonRunner(tunings, self._queue)
        self._waiting: deque[Job] = deque()
        self._job: Job | None = None
        self._is_building = False
        self._answers: list[Answer] = []

    @property
    def is_busy(self) -> bool:
        """True if a job waits or is being built. A job that `cancel` has dropped does not count."""
        return self._job is not None or bool(self._waiting)

    def add(self, request: AnyRequest, live: SwappableController | None) -> None:
        """Do the request or queue its job. `live` is the controller of the running loop, or None.

        ConfigError when the request cannot be done now.
        """
        match request:
            case Keep(slot=slot):
                self._tunings.comparison.keep(slot, self._tunings.in_force)
            case Compare(on=True) if live is not None:
                self.comparison.start(live)
            case _:
                if isinstance(request, Compare):
                    self._tunings.comparison.stop()
                self._queue(job_of(request, self._tunings, self._path))
                return
        self._answers.append((request, None))

    def adapt(self, adaptation: Adaptation) -> bool:
        """Queue the adapted rules and return True. Return False if another change waits, or while a comparison runs.

        If the displacement sensor had a fault, the rules from before the fault are queued. They are put in force even
        if the loop has ended in the meantime.
        """
        if self.is_busy or self._tunings.comparison.is_on:
            return False
        self._queue(ChangeJob(None, "", adaptation.sensor_fault is not None, Adapted(adaptation)))
        return True

    def update(self, live: SwappableController | None, now_s: float) -> Iterator[str]:
        """Put a built change in force, and begin the next job. Yield the events to report. Called at every tick."""
        result = self._builder.result() if self._is_building else None
        if result is not None:
            job, self._job, self._is_building = self._job, None, False
            if job is not None:
                yield from self._finish(job, result, live, now_s)
        if live is not None and (event := self.comparison.update(live)):
            yield event
        if not self._is_building and self._waiting:
            yield from self._begin(self._waiting.popleft(), live)

    def answers(self) -> Iterator[Answer]:
        """Return the answers to the requests that were done or refused since the last call."""
        answers, self._answers = self._answers, []
        return iter(answers)

    def cancel(self) -> None:
        """Call this when the loop has ended. Refuse the requests that are not done, and end the comparison.

        Drop all jobs, except those with `outlives_the_loop`.
        """
        under_way = [job for job in (self._job, *self._waiting) if job is not None]
        for job in under_way:
            self._answer(job, "the heater was switched off in the meantime")
        self._waiting = deque(job for job in under_way if job.outlives_the_loop)
        self._job = None
        self._tunings.end_comparison()

    def _queue(self, job: Job) -> None:
        """Append a job, or put it in the place of a waiting job that it replaces. ConfigError if too many jobs wait.

        It replaces no job before an undo, or before another job that depends on the order.
        """
        for place in reversed(range(len(self._waiting))):
            waiting = self._waiting[place]
            if job.replaces(waiting):
                self._waiting[place] = job
                self._answer(waiting, None)
                return
            if not isinstance(waiting.request, SetValue):
                break
        if len(self._waiting) >= MAX_WAITING:
            raise ConfigError(
                "too many changes wait", value=len(self._waiting), limit=MAX_WAITING, cure="wait, then try again"
            )
        self._waiting.append(job)

    def _begin(self, job: Job, live: SwappableController | None) -> Iterator[str]:
        """Send the job to the builder, or refuse it if it is not possible any more. Yield the events to report."""
        try:
            target = job.target(self._tunings, live)
        except SmadriveError as error:
            yield from self._refuse(job, str(error))
            return
        self._builder.begin(BuildRequest(*target, self._config, self._wire))
        self._job, self._is_building = job, True

    def _finish(self, job: Job, result: BuildResult, live: SwappableController | None, now_s: float) -> Iterator[str]:
        if isinstance(result, BuildFailure):
            yield from self._refuse(job, result.reason)
            return
        event = job.event_text(self._tunings)
        job.install(result, self._tunings, live, now_s)
        self._answer(job, None)
        if event:
            yield event

    def _refuse(self, job: Job, reason: str) -> Iterator[str]:
        self._answer(job, reason)
        if job.request is None:
            self._tunings.comparison.stop()
            yield f"the next tuning was refused, and the present one stays in force: {reason}"

    def _answer(self, job: Job, refused: str | None) -> None:
        if job.request is not None:
            self._answers.append((job.request, refused))
