"""Jobs of the change queue: what each kind of request has built, and what is done with the result between two ticks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import NamedTuple

from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.tuning.builder.build import Built
from smadrive.tuning.link.requests import (
    AnyRequest,
    Compare,
    Hold,
    Recall,
    SetFeedback,
    SetModel,
    SetRule,
    SetShape,
    Step,
    Track,
)
from smadrive.tuning.session.changes.swappable_controller import SwappableController
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.tuning import Change, Tuning

Path = Callable[[str | None, Tuning, float], Reference]
"""The reference of a name (None: stay there), for a tuning, from the present setpoint in mm."""


class BuildTarget(NamedTuple):
    """A tuning, the change to make in it, and the reference that it has to track; None while the heater is off."""

    tuning: Tuning
    change: Change | None
    reference: Reference | None


@dataclass(frozen=True)
class Job(ABC):
    """`request` is None for a job that no page requested; `event` is reported when the job is done.

    A job that `outlives_the_loop` is done although the loop has ended meanwhile.
    """

    request: AnyRequest | None
    event: str = ""
    outlives_the_loop: bool = False

    @abstractmethod
    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """The build that the job needs, when its turn has come. SmadriveError when it is not possible any more."""

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:
        """Put the result in force, as a change that can be undone."""
        tunings.push(built, live, now_s)

    def replaces(self, waiting: Job) -> bool:
        """Whether this job makes an earlier one that still waits needless: another value of the same thing."""
        new, old = self.request, waiting.request
        if isinstance(new, SetShape | SetFeedback) and isinstance(old, SetShape | SetFeedback):
            return new.key == old.key
        return False


@dataclass(frozen=True)
class ChangeJob(Job):
    """Change the tuning in force."""

    change: Change | None = None

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """See Job."""
        return BuildTarget(tunings.in_force, self.change, _running(live))


@dataclass(frozen=True)
class RecallJob(Job):
    """Put a kept tuning in force."""

    _: KW_ONLY
    tuning: Tuning

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:  # noqa: ARG002
        """See Job."""
        return BuildTarget(self.tuning, None, _running(live))


@dataclass(frozen=True)
class StepJob(Job):
    """Undo (-1) or redo (+1) a change."""

    _: KW_ONLY
    step: int

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """See Job."""
        tuning = tunings.history.peek(self.step)
        if tuning is None:
            raise ConfigError(f"there is nothing to {'undo' if self.step < 0 else 'redo'}")
        return BuildTarget(tuning, None, _running(live))

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:  # noqa: ARG002
        """Put it in force, and move in the history."""
        tunings.put(built, live)
        tunings.history.move(self.step)


@dataclass(frozen=True)
class PutJob(RecallJob):
    """Put a tuning in force that is no change: the one before a comparison."""

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:  # noqa: ARG002
        """Put it in force."""
        tunings.put(built, live)


@dataclass(frozen=True)
class FollowJob(Job):
    """Follow the reference of a name, or stay at the present setpoint (None)."""

    _: KW_ONLY
    path: Path
    name: str | None

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """See Job."""
        if live is None:
            raise ConfigError("the heater is off", cure="arm first")
        return BuildTarget(tunings.in_force, None, self.path(self.name, tunings.in_force, live.setpoint_mm))

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:  # noqa: ARG002
        """Follow it from now on."""
        tunings.put(built, live)


@dataclass(frozen=True)
class TurnJob(Job):
    """Build the controller of the next turn of a comparison; `ready` gets it."""

    _: KW_ONLY
    tuning: Tuning
    reference: Reference
    ready: Callable[[Built], None]

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:  # noqa: ARG002
        """See Job."""
        return BuildTarget(self.tuning, None, self.reference)

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:  # noqa: ARG002
        """Keep it ready."""
        self.ready(built)


def job_of(request: AnyRequest, tunings: Tunings, path: Path) -> Job:
    """The job of a request. ConfigError when a slot is empty, or for a request that needs no job."""
    match request:
        case SetShape() | SetFeedback() | SetRule() | SetModel():
            return ChangeJob(request, request.event, change=request)
        case Track(reference=name):
            return FollowJob(request, f"following {name}", path=path, name=name)
        case Hold():
            return FollowJob(request, "holding", path=path, name=None)
        case Step(act=act):
            changed = tunings.history.undo_name if act == "undo" else tunings.history.redo_name
            return StepJob(request, f"{act}: {changed}", step=-1 if act == "undo" else 1)
        case Recall(slot=slot):
            kept = replace(tunings.comparison.slot(slot), change=f"slot {slot}")
            return RecallJob(request, f"slot {slot} in force", tuning=kept)
        case Compare(on=False):
            return PutJob(request, "comparison ended", tuning=tunings.history.now)
    raise ConfigError("no job", where=request.act)


def _running(live: SwappableController | None) -> Reference | None:
    """The reference that is followed when the job begins: the job before it may have changed that."""
    return None if live is None else live.reference
