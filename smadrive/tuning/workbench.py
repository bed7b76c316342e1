"""Changes on their way into the loop: asked for, built and checked beside it, put in force between two ticks.

One change is built at a time, each on what the one before it made. Of a dragged slider only the latest value waits.
A change that is refused leaves everything as it is, and says why.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import NamedTuple

from smadrive.control.reference import Reference
from smadrive.control.tracking import TrackingController
from smadrive.control.wire import travel_mm
from smadrive.errors import ConfigError, SmadriveError
from smadrive.identification.adaptation import Adaptation
from smadrive.rigconfig import LimitsConfig
from smadrive.tuning.comparison import Comparison
from smadrive.tuning.history import ADAPTED, History
from smadrive.tuning.live import LiveController
from smadrive.tuning.messages import AnyRequest, Compare, Hold, Keep, Recall, SetFeedback, SetShape, Step, Track
from smadrive.tuning.tuning import CHANGES, Tuning

MOST_WAITING = 8

Build = Callable[[Tuning, Reference], TrackingController]
Path = Callable[[str | None, Tuning, float], Reference]
"""A reference by its name (None: staying there), for a tuning, from the displacement that is wanted now."""


class Prepared(NamedTuple):
    """What is ready to be put in force; no controller while the heater is off."""

    tuning: Tuning
    reference: Reference | None
    controller: TrackingController | None


@dataclass(frozen=True)
class Job:
    """What was asked for, how it is made in the workshop, what is then done between two ticks, and how that is told.

    `request` is None for what nobody asked for: the turns of a comparison.
    """

    request: AnyRequest | None
    make: Callable[[], tuple[Tuning, Reference | None]]
    install: Callable[[Prepared, LiveController | None], None]
    told: str


class Workbench:
    """What is in force, what was, what is compared, and what is being built."""

    def __init__(self, build: Build, path: Path, limits: LimitsConfig, first: Tuning, workshop: Executor) -> None:
        self.history = History(first)
        self.comparison = Comparison()
        self.in_force = first
        self._build = build
        self._path = path
        self._limits = limits
        self._workshop = workshop
        self._waiting: deque[Job] = deque()
        self._job: Job | None = None
        self._building: Future[Prepared] | None = None
        self._answers: list[tuple[AnyRequest, str | None]] = []
        self._next: Prepared | None = None
        self._cycle = 0
        self._now_s = 0.0

    def add(self, request: AnyRequest, live: LiveController | None) -> None:
        """Take a request on. ConfigError when it cannot be done now."""
        if isinstance(request, Compare):
            self._compare(request, live)
            return
        if self.comparison.is_on:
            raise ConfigError("A and B are being compared: stop the comparison first")
        if isinstance(request, Keep):
            self.comparison.keep(request.slot, self.in_force)
            self._answers.append((request, None))
            return
        self._queue(self._job_of(request, live))

    def turn(self, live: LiveController | None, now_s: float) -> Iterator[str]:
        """Once a tick: put in force what is ready, begin what waits; what there is to tell."""
        self._now_s = now_s
        job, building = self._job, self._building
        if job is not None and building is not None and building.done():
            self._job = self._building = None
            yield from self._finish(job, building, live)
        if live is not None and self.comparison.is_on:
            self._take_turns(live)
        if self._job is None and self._waiting:
            self._job = self._waiting.popleft()
            self._building = self._workshop.submit(self._prepare, self._job)

    def adapt(self, adaptation: Adaptation, live: LiveController) -> None:
        """Put the adapted rules in force, unless something else is on its way."""
        if self._job is None and not self._waiting and not self.comparison.is_on:
            feedback, reference = self.in_force.feedback, live.reference
            self._queue(
                Job(
                    None,
                    lambda: (Tuning.of(adaptation.model, feedback, ADAPTED), reference),
                    self._put_as_change,
                    "",
                )
            )

    def answers(self) -> Iterator[tuple[AnyRequest, str | None]]:
        """The requests that are done, None, or refused, with the reason."""
        answers, self._answers = self._answers, []
        return iter(answers)

    def score(self, error_mm: float) -> None:
        """The error of one tick."""
        cold_mm, hot_mm = travel_mm(self.in_force.model)
        self.comparison.sample(error_mm, hot_mm - cold_mm)

    def forget(self) -> None:
        """The loop has ended: nothing that waits is for it any more."""
        for job in (self._job, *self._waiting):
            if job is not None and job.request is not None:
                self._answers.append((job.request, "the heater was switched off meanwhile"))
        self._waiting.clear()
        self._job = self._building = self._next = None
        self.comparison.stop()
        self.in_force = self.history.now

    def _prepare(self, job: Job) -> Prepared:
        """In the workshop: make, check, and build the controller that will take over."""
        tuning, reference = job.make()
        tuning.check(self._limits, reference)
        return Prepared(tuning, reference, None if reference is None else self._build(tuning, reference))

    def _finish(self, job: Job, building: Future[Prepared], live: LiveController | None) -> Iterator[str]:
        try:
            job.install(building.result(), live)
        except SmadriveError as error:
            if job.request is None:
                self.comparison.stop()
                yield f"not put in force: {error}"
            else:
                self._answers.append((job.request, str(error)))
            return
        if job.request is not None:
            self._answers.append((job.request, None))
            yield job.told

    def _queue(self, job: Job) -> None:
        """At the end of the line, or in the place of a change of the same thing that still waits."""
        for place, waiting in enumerate(self._waiting):
            if waiting.request is not None and _is_same_thing(waiting.request, job.request):
                self._waiting[place] = job
                self._answers.append((waiting.request, None))
                return
        if len(self._waiting) >= MOST_WAITING:
            raise ConfigError("too many changes wait already: try again")
        self._waiting.append(job)

    def _job_of(self, request: AnyRequest, live: LiveController | None) -> Job:
        reference = None if live is None else live.reference
        match request:
            case Track(reference=name):
                return self._follow(request, name, live, f"following {name}")
            case Hold():
                return self._follow(request, None, live, "holding")
            case Step(act=act):
                step = -1 if act == "undo" else 1
                changed = self.history.undo_name if step < 0 else self.history.redo_name
                return Job(request, lambda: (self._past(step), reference), self._go(step), f"{act}: {changed}")
            case Recall(slot=slot):
                tuning = replace(self.comparison.slot(slot), change=f"slot {slot}")
                return Job(request, lambda: (tuning, reference), self._put_as_change, f"slot {slot} in force")
            case _ if isinstance(request, CHANGES):
                change = request
                return Job(
                    request, lambda: (self.in_force.changed(change), reference), self._put_as_change, change.told
                )
            case _:
                raise ConfigError(f"'{request.act}' is not done here")

    def _follow(self, request: AnyRequest, name: str | None, live: LiveController | None, told: str) -> Job:
        if live is None:
            raise ConfigError("arm first: the heater is off")
        return Job(request, lambda: (self.in_force, self._path(name, self.in_force, live.wanted_mm)), self._put, told)

    def _past(self, step: int) -> Tuning:
        tuning = self.history.peek(step)
        if tuning is None:
            raise ConfigError(f"there is nothing to {'undo' if step < 0 else 'redo'}")
        return tuning

    def _put(self, prepared: Prepared, live: LiveController | None) -> None:
        self.in_force = prepared.tuning
        if live is not None and prepared.controller is not None and prepared.reference is not None:
            live.exchange(prepared.controller, prepared.reference)

    def _put_as_change(self, prepared: Prepared, live: LiveController | None) -> None:
        self._put(prepared, live)
        self.history.push(prepared.tuning, self._now_s)

    def _go(self, step: int) -> Callable[[Prepared, LiveController | None], None]:
        def install(prepared: Prepared, live: LiveController | None) -> None:
            self._put(prepared, live)
            self.history.move(step)

        return install

    def _compare(self, request: Compare, live: LiveController | None) -> None:
        reference = None if live is None else live.reference
        if not request.on:
            self.comparison.stop()
            before = self.history.now
            self._queue(Job(request, lambda: (before, reference), self._put, "comparison ended"))
            return
        if live is None or not live.reference.endless:
            raise ConfigError("a comparison needs a running reference: arm, then start one")
        self.comparison.start()
        self._cycle, self._next = live.reference.cycle(live.reference_s), None
        self._answers.append((request, None))
        self._prepare_next(live)

    def _take_turns(self, live: LiveController) -> None:
        """At the end of a cycle: score it, and let the other slot drive the next one, if it is ready by now."""
        cycle = live.reference.cycle(live.reference_s)
        if cycle == self._cycle:
            return
        self._cycle = cycle
        if self._next is None:
            self.comparison.end_cycle(self.comparison.turn)
            return
        self.comparison.end_cycle(self.comparison.next_turn)
        self._put(self._next, live)
        self._next = None
        self._prepare_next(live)

    def _prepare_next(self, live: LiveController) -> None:
        tuning, reference = self.comparison.slot(self.comparison.next_turn), live.reference
        self._queue(Job(None, lambda: (tuning, reference), self._keep_ready, ""))

    def _keep_ready(self, prepared: Prepared, live: LiveController | None) -> None:  # noqa: ARG002
        self._next = prepared


def _is_same_thing(waiting: AnyRequest, request: AnyRequest | None) -> bool:
    """Whether the later of two changes makes the earlier one needless."""
    if isinstance(waiting, SetShape | SetFeedback) and isinstance(request, SetShape | SetFeedback):
        return waiting.key == request.key
    return False
