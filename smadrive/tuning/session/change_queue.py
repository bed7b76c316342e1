"""Changes on their way into the loop: asked for, built and checked beside it, put in force between two ticks.

One change is built at a time, each on what the one before it made. Of a dragged slider only the latest value waits.
A change that is refused leaves everything as it is, and says why.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, SmadriveError
from smadrive.identification.adaptation import Adaptation
from smadrive.rig.config import RigConfig
from smadrive.tuning.builder.builder import ModelBuilder, Order, Outcome, Prepared, Refused
from smadrive.tuning.history import History
from smadrive.tuning.link.messages import AnyRequest, Compare, Hold, Keep, Recall, SetFeedback, SetShape, Step, Track
from smadrive.tuning.session.comparison import Comparison
from smadrive.tuning.session.swappable_controller import SwappableController
from smadrive.tuning.tuning import CHANGES, Adapted, Change, Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import travel_mm

MOST_WAITING = 8

Path = Callable[[str | None, Tuning, float], Reference]
"""A reference by its name (None: staying there), for a tuning, from the displacement that is wanted now."""

Wanted = tuple[Tuning, Change | None, Reference | None]
"""A tuning, what is to be changed in it, and the reference that it has to track."""


@dataclass(frozen=True)
class Job:
    """What was asked for, what is wanted when its turn comes, what is done with it between two ticks, how that is told.

    `request` is None for what nobody asked for: the turns of a comparison. What `outlives_the_loop` is put in force
    although the loop has ended.
    """

    request: AnyRequest | None
    wanted: Callable[[SwappableController | None], Wanted]
    install: Callable[[Prepared, SwappableController | None], None]
    told: str
    outlives_the_loop: bool = False


class ChangeQueue:
    """What is in force, what was, what is compared, and what is being built."""

    def __init__(
        self, path: Path, config: RigConfig, balance: HeatBalance, first: Tuning, workshop: ModelBuilder
    ) -> None:
        self.history = History(first)
        self.comparison = Comparison()
        self.in_force = first
        self._path = path
        self._config = config
        self._balance = balance
        self._workshop = workshop
        self._waiting: deque[Job] = deque()
        self._job: Job | None = None
        self._is_building = False
        self._answers: list[tuple[AnyRequest, str | None]] = []
        self._next: Prepared | None = None
        self._cycle = 0
        self._now_s = 0.0

    def add(self, request: AnyRequest, live: SwappableController | None) -> None:
        """Take a request on. ConfigError when it cannot be done now."""
        if isinstance(request, Compare):
            self._compare(request, live)
            return
        self.check_compares_nothing()
        if isinstance(request, Keep):
            self.comparison.keep(request.slot, self.in_force)
            self._answers.append((request, None))
            return
        self._queue(self._job_of(request, live))

    def check_compares_nothing(self) -> None:
        """ConfigError while A and B are compared: nothing else may change then."""
        if self.comparison.is_on:
            raise ConfigError("A and B are being compared: stop the comparison first")

    def turn(self, live: SwappableController | None, now_s: float) -> Iterator[str]:
        """Once a tick: put in force what is ready, begin what waits; what there is to tell."""
        self._now_s = now_s
        outcome = self._workshop.outcome() if self._is_building else None
        if outcome is not None:
            job, self._job, self._is_building = self._job, None, False
            if job is not None:
                yield from self._finish(job, outcome, live)
        if live is not None and self.comparison.is_on:
            self._take_turns(live)
        if not self._is_building and self._waiting:
            yield from self._begin(self._waiting.popleft(), live)

    @property
    def is_busy(self) -> bool:
        """Whether something is on its way into force."""
        return self._job is not None or bool(self._waiting)

    def adapt(self, adaptation: Adaptation) -> bool:
        """Put the adapted rules in force, unless something else is on its way; whether that was begun.

        What an adaptation that found its sensor lying takes back must not stay in force when the loop ends first.
        """
        if self.is_busy or self.comparison.is_on:
            return False
        change, takes_back = Adapted(adaptation), adaptation.lying is not None
        self._queue(
            Job(None, lambda live: (self.in_force, change, _running(live)), self._put_as_change, "", takes_back)
        )
        return True

    def answers(self) -> Iterator[tuple[AnyRequest, str | None]]:
        """The requests that are done, None, or refused, with the reason."""
        answers, self._answers = self._answers, []
        return iter(answers)

    def score(self, error_mm: float) -> None:
        """The error of one tick."""
        cold_mm, hot_mm = travel_mm(self.in_force.model)
        self.comparison.sample(error_mm, hot_mm - cold_mm)

    def forget(self) -> None:
        """The loop has ended: nothing that waits is for it any more, but what outlives it."""
        under_way = [job for job in (self._job, *self._waiting) if job is not None]
        for job in under_way:
            if job.request is not None:
                self._answers.append((job.request, "the heater was switched off meanwhile"))
        self._waiting = deque(job for job in under_way if job.outlives_the_loop)
        self._job = self._next = None
        self.comparison.stop()
        self.in_force = self.history.now

    def _begin(self, job: Job, live: SwappableController | None) -> Iterator[str]:
        """Give it to the workshop, unless it cannot be done any more."""
        try:
            tuning, change, reference = job.wanted(live)
        except SmadriveError as error:
            yield from self._refuse(job, str(error))
            return
        self._workshop.begin(Order(tuning, change, reference, self._config, self._balance))
        self._job, self._is_building = job, True

    def _finish(self, job: Job, outcome: Outcome, live: SwappableController | None) -> Iterator[str]:
        if isinstance(outcome, Refused):
            yield from self._refuse(job, outcome.reason)
            return
        job.install(outcome, live)
        if job.request is not None:
            self._answers.append((job.request, None))
            yield job.told

    def _refuse(self, job: Job, reason: str) -> Iterator[str]:
        if job.request is not None:
            self._answers.append((job.request, reason))
            return
        self.comparison.stop()
        yield f"not put in force: {reason}"

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

    def _job_of(self, request: AnyRequest, live: SwappableController | None) -> Job:
        match request:
            case Track(reference=name):
                return self._follow(request, name, live, f"following {name}")
            case Hold():
                return self._follow(request, None, live, "holding")
            case Step(act=act):
                step = -1 if act == "undo" else 1
                changed = self.history.undo_name if step < 0 else self.history.redo_name
                return Job(
                    request, lambda live: (self._past(step), None, _running(live)), self._go(step), f"{act}: {changed}"
                )
            case Recall(slot=slot):
                tuning = replace(self.comparison.slot(slot), change=f"slot {slot}")
                return Job(
                    request, lambda live: (tuning, None, _running(live)), self._put_as_change, f"slot {slot} in force"
                )
            case _ if isinstance(request, CHANGES):
                change = request
                return Job(
                    request, lambda live: (self.in_force, change, _running(live)), self._put_as_change, change.told
                )
            case _:
                raise ConfigError(f"'{request.act}' is not done here")

    def _follow(self, request: AnyRequest, name: str | None, live: SwappableController | None, told: str) -> Job:
        if live is None:
            raise ConfigError("arm first: the heater is off")

        def wanted(_: SwappableController | None) -> Wanted:
            return self.in_force, None, self._path(name, self.in_force, live.setpoint_mm)

        return Job(request, wanted, self._put, told)

    def _past(self, step: int) -> Tuning:
        tuning = self.history.peek(step)
        if tuning is None:
            raise ConfigError(f"there is nothing to {'undo' if step < 0 else 'redo'}")
        return tuning

    def _put(self, prepared: Prepared, live: SwappableController | None) -> None:
        self.in_force = prepared.tuning
        if live is not None and prepared.controller is not None and prepared.reference is not None:
            live.exchange(prepared.controller, prepared.reference)

    def _put_as_change(self, prepared: Prepared, live: SwappableController | None) -> None:
        self._put(prepared, live)
        self.history.push(prepared.tuning, self._now_s)

    def _go(self, step: int) -> Callable[[Prepared, SwappableController | None], None]:
        def install(prepared: Prepared, live: SwappableController | None) -> None:
            self._put(prepared, live)
            self.history.move(step)

        return install

    def _compare(self, request: Compare, live: SwappableController | None) -> None:
        if not request.on:
            self.comparison.stop()
            before = self.history.now
            self._queue(Job(request, lambda live: (before, None, _running(live)), self._put, "comparison ended"))
            return
        if live is None or not live.reference.endless:
            raise ConfigError("a comparison needs a running reference: arm, then start one")
        self.comparison.start()
        self._cycle, self._next = live.reference.cycle(live.reference_s), None
        self._answers.append((request, None))
        self._prepare_next(live)

    def _take_turns(self, live: SwappableController) -> None:
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

    def _prepare_next(self, live: SwappableController) -> None:
        tuning, reference = self.comparison.slot(self.comparison.next_turn), live.reference
        self._queue(Job(None, lambda _: (tuning, None, reference), self._keep_ready, ""))

    def _keep_ready(self, prepared: Prepared, live: SwappableController | None) -> None:  # noqa: ARG002
        self._next = prepared


def _running(live: SwappableController | None) -> Reference | None:
    """What is followed now; to be asked when a job begins, since the one before it may have changed that."""
    return None if live is None else live.reference


def _is_same_thing(waiting: AnyRequest, request: AnyRequest | None) -> bool:
    """Whether the later of two changes makes the earlier one needless."""
    if isinstance(waiting, SetShape | SetFeedback) and isinstance(request, SetShape | SetFeedback):
        return waiting.key == request.key
    return False
