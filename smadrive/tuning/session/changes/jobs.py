"""Jobs of the change queue. A job defines what the builder builds, and installs the result between two ticks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import ClassVar, NamedTuple

from smadrive.control.controllers.swappable import SwappableController
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
    SetSource,
    SetValue,
    Step,
    Track,
)
from smadrive.tuning.session.changes.tunings import Tunings
from smadrive.tuning.tuning import Change, Tuning

ReferenceLookup = Callable[[str | None, Tuning, float], Reference]
"""A function of the name of a reference, a tuning and the present setpoint in mm. It returns the reference to track.

Without a name (None), the reference stays at the present setpoint.
"""


class BuildTarget(NamedTuple):
    """The part of a BuildRequest that a job sets: a tuning, the change to make in the tuning, the reference to track.

    `change` is None for a tuning that stays as it is. `reference` is None while the heater is off.
    """

    tuning: Tuning
    change: Change | None
    reference: Reference | None


@dataclass(frozen=True)
class Job(ABC):
    """One job of the change queue.

    `request` is None for a job that no page requested. `event` is reported when the job is done (see `event_text`). A
    job with `outlives_the_loop` is done even if the loop has ended in the meantime. A job with `is_undoable` adds its
    tuning to the history of changes.
    """

    is_undoable: ClassVar[bool] = True
    request: AnyRequest | None
    event: str = ""
    outlives_the_loop: bool = False

    @abstractmethod
    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """Return the part of the build request that the job sets. SmadriveError if the job is not possible now."""

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:
        """Put the built tuning and its controller in force."""
        if self.is_undoable:
            tunings.push(built, live, now_s)
        else:
            tunings.put(built, live)

    def event_text(self, tunings: Tunings) -> str:  # noqa: ARG002
        """Return the event to report; empty without one. Called right before `install`."""
        return self.event

    def replaces(self, waiting: Job) -> bool:
        """Return True if this job sets the same number as the job `waiting`, so that `waiting` can be dropped."""
        new, old = self.request, waiting.request
        return isinstance(new, SetValue) and isinstance(old, SetValue) and new.key == old.key


@dataclass(frozen=True)
class ChangeJob(Job):
    """Change the tuning in force."""

    change: Change | None = None

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """Return the tuning in force, the change to make in it, and the reference that the loop tracks."""
        return BuildTarget(tunings.in_force, self.change, _running(live))


@dataclass(frozen=True)
class RecallJob(Job):
    """Put a tuning in force, for example that of slot A or B."""

    _: KW_ONLY
    tuning: Tuning

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:  # noqa: ARG002
        """Return the tuning, and the reference that the loop tracks (None without a loop)."""
        return BuildTarget(self.tuning, None, _running(live))


@dataclass(frozen=True)
class StepJob(Job):
    """Undo (-1) or redo (+1) a change."""

    _: KW_ONLY
    step: int
    is_undoable = False

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """Return the tuning that undo or redo leads to."""
        tuning = tunings.history.peek(self.step)
        if tuning is None:
            raise ConfigError(f"there is no change to {'undo' if self.step < 0 else 'redo'}")
        return BuildTarget(tuning, None, _running(live))

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:
        """Put the tuning in force, and go one change back or forward in the history."""
        super().install(built, tunings, live, now_s)
        tunings.history.move(self.step)

    def event_text(self, tunings: Tunings) -> str:
        """Return the event with the name of the change, which was perhaps still being built at the request."""
        history = tunings.history
        return f"undo: {history.undo_name}" if self.step < 0 else f"redo: {history.redo_name}"


@dataclass(frozen=True)
class PutJob(RecallJob):
    """Use the tuning again that was used before the A/B comparison. Undo and redo ignore this change."""

    is_undoable = False


@dataclass(frozen=True)
class FollowJob(Job):
    """Track the reference `name`. If `name` is None, stay at the present setpoint."""

    is_undoable = False
    _: KW_ONLY
    path: ReferenceLookup
    name: str | None

    def target(self, tunings: Tunings, live: SwappableController | None) -> BuildTarget:
        """Return the tuning in force with the new reference."""
        if live is None:
            raise ConfigError("the heater is off", cure="arm first")
        return BuildTarget(tunings.in_force, None, self.path(self.name, tunings.in_force, live.setpoint_mm))


@dataclass(frozen=True)
class TurnJob(RecallJob):
    """Build the controller of the tuning that drives next in a comparison. Call `ready` with the result."""

    _: KW_ONLY
    ready: Callable[[Built], None]

    def install(self, built: Built, tunings: Tunings, live: SwappableController | None, now_s: float) -> None:  # noqa: ARG002
        """Call `ready` with the built tuning and controller. The comparison puts them in force later."""
        self.ready(built)


def job_of(request: AnyRequest, tunings: Tunings, path: ReferenceLookup) -> Job:
    """Return the job that a request needs. ConfigError when a slot is empty, or when the request needs no job."""
    match request:
        case SetShape() | SetFeedback() | SetSource() | SetRule() | SetModel():
            return ChangeJob(request, request.event, change=request)
        case Track(reference=name):
            return FollowJob(request, f"following {name}", path=path, name=name)
        case Hold():
            return FollowJob(request, "holding", path=path, name=None)
        case Step(act=act):
            return StepJob(request, step=-1 if act == "undo" else 1)
        case Recall(slot=slot):
            kept = replace(tunings.comparison.slot(slot), change=f"slot {slot}")
            return RecallJob(request, f"slot {slot} in force", tuning=kept)
        case Compare(on=False):
            return PutJob(request, "comparison ended", tuning=tunings.history.now)
    raise ConfigError("this request needs no job", where=request.act)


def _running(live: SwappableController | None) -> Reference | None:
    """Return the reference that the loop tracks, None without a loop. An earlier job may have changed it."""
    return None if live is None else live.reference
