"""The requests of a page: typed, bounded, and checked in the control process.

A request carries a number that its answer repeats: `{"number": 7, "refused": null}`, or the reason in words. A request
that drives the wire carries also the count of OFFs that its page knew, so that it cannot come after an OFF.
"""

from __future__ import annotations

import reprlib
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from smadrive.errors import ConfigError
from smadrive.files.config import Section

Slot = Literal["A", "B"]
ShapeKey = Literal["mu_heating", "mu_cooling", "sigma_heating", "sigma_cooling", "scale"]
FeedbackKey = Literal["closed_loop_s", "integral_s", "feedforward_share"]


class PageRequest(Section):
    """The base of all requests."""

    number: int = Field(ge=0)


class DrivingRequest(PageRequest):
    """A request that drives the wire. `offs`: how many times OFF was pressed, as far as its page knew."""

    offs: int = Field(ge=0)


class Off(PageRequest):
    """Switch the heater off; the counter of the channel does the same without a queue."""

    act: Literal["off"]


class Arm(DrivingRequest):
    """Start the control loop, which holds the wire where it is."""

    act: Literal["arm"]


class ClearFaults(PageRequest):
    """Clear the latched faults, once their cause is removed."""

    act: Literal["clear"]


class Track(DrivingRequest):
    """Follow a reference again and again: one of the session by its name, or any other in its one-line form."""

    act: Literal["track"]
    reference: str = Field(min_length=1, max_length=300)


class Hold(DrivingRequest):
    """Stay where the reference is now."""

    act: Literal["hold"]


class SetShape(PageRequest):
    """Move a branch, or the scale."""

    act: Literal["shape"]
    key: ShapeKey
    value: float

    @property
    def event(self) -> str:
        """The line among the events when it is in force."""
        return f"{self.key} = {self.value:g}"


class SetFeedback(PageRequest):
    """Change a gain of the feedback, or the share of the feedforward."""

    act: Literal["feedback"]
    key: FeedbackKey
    value: float

    @property
    def event(self) -> str:
        """The line among the events when it is in force."""
        return f"{self.key} = {self.value:g}"


class SetRule(PageRequest):
    """Give a rule another consequent: dw = (a w + b) dv."""

    act: Literal["rule"]
    index: int = Field(ge=0, le=200)
    direction: Literal[1, -1]
    a: float
    b: float

    @property
    def event(self) -> str:
        """The line among the events when it is in force."""
        branch = "heating" if self.direction > 0 else "cooling"
        return f"rule {self.index + 1} {branch}: a = {self.a:g}, b = {self.b:g}"


class SetModel(PageRequest):
    """Take another model, as the text of its file. `source`: where it comes from; `caveats`: reasons to distrust it."""

    act: Literal["model"]
    text: str
    source: str = Field(max_length=300)
    caveats: tuple[Annotated[str, Field(max_length=600)], ...] = Field(default=(), max_length=8)

    @property
    def event(self) -> str:
        """The line among the events when it is in force."""
        return f"model: {self.source}"


class Note(PageRequest):
    """Add a text to the events, which all pages see."""

    act: Literal["note"]
    text: str = Field(max_length=2000)


class Step(PageRequest):
    """Undo or redo one change."""

    act: Literal["undo", "redo"]


class Keep(PageRequest):
    """Keep the tuning in force in a slot."""

    act: Literal["keep"]
    slot: Slot


class Recall(PageRequest):
    """Put the tuning of a slot in force."""

    act: Literal["recall"]
    slot: Slot


class Compare(DrivingRequest):
    """Alternate between both slots at every cycle of the reference, and score them."""

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
    """The request in a message. ConfigError names the key that is wrong."""
    try:
        return _REQUESTS.validate_json(message)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"][1:]) or "request"
        raise ConfigError(first["msg"], where=key, value=reprlib.repr(first["input"])) from None


class _NumberedMessage(PageRequest, extra="ignore"):
    """The number of any message."""


def numbered(message: bytes) -> PageRequest | None:
    """The number by which a malformed request is answered; None for a message without one."""
    try:
        return _NumberedMessage.model_validate_json(message)
    except ValidationError:
        return None
