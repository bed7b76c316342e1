"""Build requests: the model builder process changes a tuning, checks it and builds its controller.

A request holds everything that the builder needs, so a new process can replace a builder that died. The builder works
on one request at a time. The loop spends time only on packing and sending a request of some kilobytes, and on
unpickling the result (see packing.py).
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
from smadrive.wire.wire_properties import WireProperties


@dataclass(frozen=True)
class BuildRequest:
    """The request to apply `change` to `tuning`, and to build a controller that tracks `reference`.

    `change` is None if the tuning stays as it is. `reference` is None while the heater is off; then no controller is
    built. `config` is the rig file. `wire` has the properties of the wire that no change alters.
    """

    tuning: Tuning
    change: Change | None
    reference: Reference | None
    config: RigConfig
    wire: WireProperties


class Built(NamedTuple):
    """A checked tuning and its controller, ready to be put in force.

    `reference` and `controller` are None while the heater is off.
    """

    tuning: Tuning
    reference: Reference | None
    controller: TrackingController | None


class BuildFailure(NamedTuple):
    """The result of a request whose tuning cannot be put in force; `reason` says why."""

    reason: str


BuildResult = Built | BuildFailure


class ModelBuilder(Protocol):
    """Builds tunings with their controllers, one request at a time."""

    def begin(self, request: BuildRequest) -> None:
        """Begin to build `request`. Call this only after `result` has returned the result of the previous request."""
        ...

    def result(self) -> BuildResult | None:
        """Return the result of the request when it is ready, only once. At all other times, return None."""
        ...


def build(request: BuildRequest) -> Built:
    """Return the changed and checked tuning of a request, with its controller.

    ConfigError, ModelError or CertificateError when the tuning cannot be put in force.
    """
    tuning = request.tuning if request.change is None else request.tuning.changed(request.change)
    request.config.check_feedback(tuning.feedback)
    tuning.check(request.config.limits, request.reference)
    if request.reference is None:
        return Built(tuning, None, None)
    controller = tuned_controller(tuning, request.reference, request.config, request.wire)
    return Built(tuning, request.reference, controller)


def tuned_controller(
    tuning: Tuning, reference: Reference, config: RigConfig, wire: WireProperties
) -> TrackingController:
    """Return the controller that tracks `reference` with a tuning. All other settings come from the rig file."""
    tuned = config.model_copy(update={"feedback": tuning.feedback})
    inverse = HysteresisInverse(tuning.model)
    return tracking_controller(tuned, reference, wire.wire_model(tuning.model), inverse, tuning.displacement_from)
