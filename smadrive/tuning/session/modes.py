"""The modes of a tuning session, and the table of the requests that each mode refuses.

The session checks requests by this table, and the pages disable the buttons of the acts that it refuses.

    mode        heater   next modes
    IDLE        off      Arm → ARMING
    TRIPPED     off      Arm → ARMING; Clear faults → IDLE
    ARMING      off      start of the loop → HOLDING; OFF, or a change that takes too long → the mode before Arm; a
                         fault → TRIPPED
    HOLDING     on       Track → TRACKING; OFF → IDLE; a fault, or a silent front process → TRIPPED
    TRACKING    on       Hold → HOLDING; Compare → COMPARING; OFF and faults as for HOLDING
    COMPARING   on       end of the comparison → TRACKING; OFF and faults as for HOLDING
    ENDED       off      none: the session has ended

When a stop is requested, the mode stays the same until the loop ends. The loop ends before its next exchange with the
heater.
"""

from __future__ import annotations

from enum import Enum
from functools import cache
from typing import NamedTuple, get_args

from smadrive.errors import ConfigError
from smadrive.tuning.link.requests import (
    Adapt,
    AnyRequest,
    Arm,
    ClearFaults,
    Compare,
    Hold,
    Keep,
    PageRequest,
    Recall,
    SetFeedback,
    SetModel,
    SetRule,
    SetShape,
    SetSource,
    Step,
    Track,
)


class Mode(Enum):
    """The modes of a session."""

    IDLE = "idle"
    TRIPPED = "tripped"
    ARMING = "arming"
    HOLDING = "holding"
    TRACKING = "tracking"
    COMPARING = "comparing"
    ENDED = "ended"

    @property
    def heats(self) -> bool:
        """True in the modes in which the control loop runs."""
        return self in HEATING


HEATING = frozenset({Mode.HOLDING, Mode.TRACKING, Mode.COMPARING})
OFF = frozenset(Mode) - HEATING

CHANGES = (SetShape, SetFeedback, SetSource, SetRule, SetModel, Step, Keep, Recall, Adapt)


class ModeRule(NamedTuple):
    """Requests of the types `requests` are refused in `modes`; `what` and `cure` are the texts of the error."""

    requests: tuple[type[PageRequest], ...]
    modes: frozenset[Mode]
    what: str
    cure: str = ""


MODE_RULES = (
    ModeRule((Arm,), HEATING | {Mode.ARMING}, "the heater is armed already"),
    ModeRule((ClearFaults,), HEATING, "the heater is on", "switch it off before clearing faults"),
    ModeRule((Track, Hold), OFF, "the heater is off", "arm first"),
    ModeRule(
        (Track, Hold, *CHANGES), frozenset({Mode.COMPARING}), "A and B are being compared", "stop the comparison first"
    ),
    ModeRule(
        (Compare,),
        frozenset(Mode) - {Mode.TRACKING, Mode.COMPARING},
        "a comparison needs a running reference",
        "arm, then start a reference",
    ),
)


def check_allowed(request: AnyRequest, mode: Mode) -> None:
    """Raise ConfigError when the mode refuses the request. The end of a comparison is refused in no mode."""
    if isinstance(request, Compare) and not request.on:
        return
    for requests, modes, what, cure in MODE_RULES:
        if isinstance(request, requests) and mode in modes:
            raise ConfigError(what, cure=cure)


@cache
def refused_acts(mode: Mode) -> tuple[str, ...]:
    """Return the acts that the mode refuses, in alphabetical order. An act is the field `act` of a request.

    `compare` stands for the beginning of a comparison.
    """
    kinds = {kind for rule in MODE_RULES if mode in rule.modes for kind in rule.requests}
    return tuple(sorted(act for kind in kinds for act in _acts_of(kind)))


def _acts_of(kind: type[PageRequest]) -> tuple[str, ...]:
    """Return the values that the field `act` of a type of request can have."""
    return get_args(kind.model_fields["act"].annotation)
