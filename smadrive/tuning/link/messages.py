"""What a page may ask: typed, bounded, checked in the control process, whatever the page has checked before.

A request carries a number by which its answer is known: `{"number": 7, "refused": null}`, or the reason in words. One
that drives the wire carries also how many OFFs were known to who asked, so that it cannot come after one that was not.
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


class Request(Section):
    """What all requests have."""

    number: int = Field(ge=0)


class Driving(Request):
    """What drives the wire: `offs` is how many times OFF had been pressed as far as was known when it was asked."""

    offs: int = Field(ge=0)


class Off(Request):
    """Heater off; the counter of the channel does the same without a queue."""

    act: Literal["off"]


class Arm(Driving):
    """Begin to heat, holding the wire where it is."""

    act: Literal["arm"]


class ClearFaults(Request):
    """Clear what is latched, once its cause is removed."""

    act: Literal["clear"]


class Track(Driving):
    """Follow a reference, one of the session's by its name or one in its one-line form, again and again."""

    act: Literal["track"]
    reference: str = Field(min_length=1, max_length=300)


class Hold(Driving):
    """Stay where the reference is now."""

    act: Literal["hold"]


class SetShape(Request):
    """Move a branch, or the scale."""

    act: Literal["shape"]
    key: ShapeKey
    value: float

    @property
    def told(self) -> str:
        """What is told of it."""
        return f"{self.key} = {self.value:g}"


class SetFeedback(Request):
    """Change a gain of the feedback, or the share of the feedforward."""

    act: Literal["feedback"]
    key: FeedbackKey
    value: float

    @property
    def told(self) -> str:
        """What is told of it."""
        return f"{self.key} = {self.value:g}"


class SetRule(Request):
    """Give a rule another consequent: dw = (a w + b) dv."""

    act: Literal["rule"]
    index: int = Field(ge=0, le=200)
    direction: Literal[1, -1]
    a: float
    b: float

    @property
    def told(self) -> str:
        """What is told of it."""
        branch = "heating" if self.direction > 0 else "cooling"
        return f"rule {self.index + 1} {branch}: a = {self.a:g}, b = {self.b:g}"


class SetModel(Request):
    """Take another model, as the text of its file; `source` is where it comes from, `caveats` what lets doubt it."""

    act: Literal["model"]
    text: str
    source: str = Field(max_length=300)
    caveats: tuple[Annotated[str, Field(max_length=600)], ...] = Field(default=(), max_length=8)

    @property
    def told(self) -> str:
        """What is told of it."""
        return f"model: {self.source}"


class Note(Request):
    """Have a text stand among the events, which all pages see."""

    act: Literal["note"]
    text: str = Field(max_length=2000)


class Step(Request):
    """One change back, or forth again."""

    act: Literal["undo", "redo"]


class Keep(Request):
    """Keep what is in force in a slot."""

    act: Literal["keep"]
    slot: Slot


class Recall(Request):
    """Put in force what a slot keeps."""

    act: Literal["recall"]
    slot: Slot


class Compare(Driving):
    """Alternate between both slots at every cycle of the reference, and score them."""

    act: Literal["compare"]
    on: bool


class Adapt(Request):
    """Let the adaptation change the rules, or not."""

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
    """The request in a message; ConfigError says what is wrong with it."""
    try:
        return _REQUESTS.validate_json(message)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"][1:]) or "request"
        raise ConfigError(f"{key}: {first['msg']} (it is {reprlib.repr(first['input'])})") from None


class _Numbered(Request, extra="ignore"):
    """Of any message, the number."""


def numbered(message: bytes) -> Request | None:
    """What a message that is no request can be answered by: its number; None if not even that is in it."""
    try:
        return _Numbered.model_validate_json(message)
    except ValidationError:
        return None
