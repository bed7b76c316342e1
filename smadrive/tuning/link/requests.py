"""The requests of a page. The driver checks their types and ranges.

A request carries a number, which the answer repeats: `{"number": 7, "refused": null}`. If the request is refused,
`refused` is the reason. A request that drives the wire also carries the OFF count that the page had received when the
user clicked. The driver refuses the request if an OFF was counted since then.
"""

from __future__ import annotations

import reprlib
from typing import Annotated, ClassVar, Literal

from pydantic import Field, TypeAdapter, ValidationError

from smadrive.errors import ConfigError
from smadrive.files.config import Section
from smadrive.measurement import DisplacementFrom

Slot = Literal["A", "B"]
ShapeKey = Literal["mu_heating", "mu_cooling", "sigma_heating", "sigma_cooling", "scale"]
FeedbackKey = Literal["closed_loop_s", "integral_s", "feedforward_share"]


class PageRequest(Section):
    """The base of all requests. The answer to a request repeats its `number`."""

    number: int = Field(ge=0)


class DrivingRequest(PageRequest):
    """A request that drives the wire. `offs` is the OFF count that the page had received when the user clicked."""

    offs: int = Field(ge=0)


class Off(PageRequest):
    """Switch the heater off; the Disarm button sends this request.

    The OFF button does not send it: it increments the OFF count of the channel, which needs no queue.
    """

    act: Literal["off"]


class Arm(DrivingRequest):
    """Start the control loop, which holds the wire at its present displacement."""

    act: Literal["arm"]


class ClearFaults(PageRequest):
    """Clear the latched faults. The user must remove their causes first."""

    act: Literal["clear"]


class Track(DrivingRequest):
    """Track a reference and repeat it without end.

    `reference` is a name in the ReferenceCatalogue, or a one-line form such as `sine:low_mm=2,high_mm=9,period_s=56`.
    """

    act: Literal["track"]
    reference: str = Field(min_length=1, max_length=300)


class Hold(DrivingRequest):
    """Hold the present setpoint."""

    act: Literal["hold"]


class SetValue(PageRequest):
    """Set the number `key` of the tuning to `value`."""

    key: str
    value: float

    @property
    def event(self) -> str:
        """The text of the event that reports that the change is in force."""
        return f"{self.key} = {self.value:g}"


class SetShape(SetValue):
    """Change the model: move or widen a branch, or change the scale of the displacement."""

    act: Literal["shape"]
    key: ShapeKey


class SetFeedback(SetValue):
    """Change a time constant of the feedback, or the share of the feedforward."""

    act: Literal["feedback"]
    key: FeedbackKey


class SetSource(PageRequest):
    """Take the displacement from another source."""

    act: Literal["source"]
    displacement_from: DisplacementFrom

    key: ClassVar[str] = "displacement_from"

    @property
    def event(self) -> str:
        """The text of the event that reports that the change is in force."""
        return f"{self.key} = {self.displacement_from.value}"


class SetRule(PageRequest):
    """Replace the consequent dw = (a w + b) dv of a rule; w is the state of the model, v the wire temperature.

    `index` counts the fuzzy sets from 0. `direction` is 1 for the heating rule of the set, -1 for its cooling rule.
    """

    act: Literal["rule"]
    index: int = Field(ge=0)
    direction: Literal[1, -1]
    a: float
    b: float

    @property
    def branch(self) -> Literal["heating", "cooling"]:
        """The branch to which the rule belongs."""
        return "heating" if self.direction > 0 else "cooling"

    @property
    def name(self) -> str:
        """The name of the rule for users."""
        return f"rule {self.index + 1} {self.branch}"

    @property
    def event(self) -> str:
        """The text of the event that reports that the change is in force."""
        return f"{self.name}: a = {self.a:g}, b = {self.b:g}"


class SetModel(PageRequest):
    """Replace the model. `text` is the text of a model file.

    `source` says where the model comes from; `caveats` are reasons to distrust the model.
    """

    act: Literal["model"]
    text: str
    source: str = Field(max_length=300)
    caveats: tuple[Annotated[str, Field(max_length=600)], ...] = Field(default=(), max_length=8)

    @property
    def event(self) -> str:
        """The text of the event that reports that the change is in force."""
        return f"model: {self.source}"


class Note(PageRequest):
    """Add a text to the events, so that all pages show it."""

    act: Literal["note"]
    text: str = Field(max_length=2000)


class Step(PageRequest):
    """Go one change back (`undo`) or forward (`redo`) in the history."""

    act: Literal["undo", "redo"]


class Keep(PageRequest):
    """Store the tuning in force in slot A or B, for a comparison or for `Recall`."""

    act: Literal["keep"]
    slot: Slot


class Recall(PageRequest):
    """Put the tuning that is stored in slot A or B in force."""

    act: Literal["recall"]
    slot: Slot


class Compare(DrivingRequest):
    """Begin or end a comparison: the tunings in slots A and B drive the wire in turn, one cycle each."""

    act: Literal["compare"]
    on: bool


class Adapt(PageRequest):
    """Switch the online adaptation of the rules on or off."""

    act: Literal["adapt"]
    on: bool


AnyRequest = Annotated[
    Off
    | Arm
    | ClearFaults
    | Track
    | Hold
    | SetShape
    | SetFeedback
    | SetSource
    | SetRule
    | SetModel
    | Note
    | Step
    | Keep
    | Recall
    | Compare
    | Adapt,
    Field(discriminator="act"),
]

_REQUESTS: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)


def parse_request(message: bytes) -> AnyRequest:
    """Return the request in a message. ConfigError for a malformed request; its `where` is the wrong key."""
    try:
        return _REQUESTS.validate_json(message)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"][1:]) or "request"
        raise ConfigError(first["msg"], where=key, value=reprlib.repr(first["input"])) from None


class _NumberedMessage(PageRequest, extra="ignore"):
    """A message with a number. Its other keys are not read."""


def numbered(message: bytes) -> PageRequest | None:
    """Return a PageRequest with the number of the message, for a refusal. Return None if the message has no number.

    Everything else in the message may be malformed.
    """
    try:
        return _NumberedMessage.model_validate_json(message)
    except ValidationError:
        return None
