"""Build requests: a model is changed and checked, and its controller built, in a process beside the loop.

A request is complete in itself, so that a builder that died is replaced by a new one. One request is worked on at a
time. The loop pays for sending a request of some kilobytes and for unpickling the result (see packing.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.reference import Reference
from smadrive.rig.config import RigConfig
from smadrive.rig.controllers import tracking_controller
from smadrive.tuning.tuning import Change, Tuning
from smadrive.wire.heat_balance import HeatBalance


@dataclass(frozen=True)
class BuildRequest:
    """A tuning, the change to make in it, and the reference that it has to track; None while the heater is off."""

    tuning: Tuning
    change: Change | None
    reference: Reference | None
    config: RigConfig
    balance: HeatBalance


class Built(NamedTuple):
    """A checked tuning and its controller, ready to be put in force; no controller while the heater is off."""

    tuning: Tuning
    reference: Reference | None
    controller: TrackingController | None


class BuildFailure(NamedTuple):
    """Why the request cannot be put in force."""

    reason: str


BuildResult = Built | BuildFailure


class ModelBuilder(Protocol):
    """Works on one request at a time."""

    def begin(self, request: BuildRequest) -> None:
        """Begin to work on a request; the result of the one before must have been fetched."""
        ...

    def result(self) -> BuildResult | None:
        """The result of the request, once; None while it is being worked on."""
        ...


def build(request: BuildRequest) -> Built:
    """Change and check the tuning, and build its controller. ConfigError, ModelError, CertificateError."""
    tuning = request.tuning if request.change is None else request.tuning.changed(request.change)
    request.config.check_feedback(tuning.feedback)
    tuning.check(request.config.limits, request.reference)
    if request.reference is None:
        return Built(tuning, None, None)
    controller = tuned_controller(tuning, request.reference, request.config, request.balance)
    return Built(tuning, request.reference, controller)


def tuned_controller(
    tuning: Tuning, reference: Reference, config: RigConfig, balance: HeatBalance
) -> TrackingController:
    """The controller of a tuning on a reference; its other settings are those of the rig file."""
    tuned = config.model_copy(update={"feedback": tuning.feedback})
    return tracking_controller(tuned, reference, tuning.model, balance, HysteresisInverse(tuning.model))
