"""FAULTS.toml: what goes wrong with a simulated rig, and when.

    [[faults]]              # at a time of the rig: the method of that name is called with the other keys
    at_s = 12.0
    name = "delay"
    delay_s = 0.3
    replies = 5             # or for_s = 2.0

    [random]                # drawn by the simulator's seed, beside the timeline
    share = 0.1             # of the replies
    slowest_s = 0.5         # the longest delay, pause and absence
    copies = true           # also frames of no request behind the next request: plain RTU cannot tell them
    lag = true              # also replies that are each the one before: neither RTU nor TCP can tell

Names and keys are those of the methods, so that a script can do whatever a test can.
"""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from pydantic import ConfigDict, Field, create_model

from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config, validate
from smadrive.files.kinds import FAULTS, check_kind
from smadrive.files.spelling import suggestion_or_list

Fault = Callable[..., None]
_ROUNDING_S = 1e-9


class RandomConfig(Section):
    """Faults of the bus by chance."""

    share: float = Field(gt=0, le=1)
    slowest_s: float = Field(default=0.5, gt=0)
    copies: bool = False
    lag: bool = False


class Entry(Section):
    """One fault; the keys beside these are its parameters."""

    model_config = ConfigDict(extra="allow")

    at_s: float = Field(ge=0)
    name: str


class FaultScript(Section):
    """A whole FAULTS.toml."""

    faults: tuple[Entry, ...] = ()
    random: RandomConfig | None = None


class Event(NamedTuple):
    """A fault bound to its parameters."""

    at_s: float
    text: str
    begin: Callable[[], None]


class Timeline:
    """Events in the order of their times."""

    def __init__(self, events: Sequence[Event] = (), tell: Callable[[str], None] = lambda _text: None) -> None:
        """`tell` gets a line per event that happens."""
        self._coming = deque(sorted(events, key=lambda event: event.at_s))
        self._tell = tell

    def pass_time(self, time_s: float) -> None:
        """Let everything happen that is due."""
        while self._coming and self._coming[0].at_s <= time_s + _ROUNDING_S:
            event = self._coming.popleft()
            self._tell(f"fault: {event.text}")
            event.begin()


def load_script(path: Path) -> FaultScript:
    """The file at `path`; ConfigError names file, key and cure."""
    check_kind(path, FAULTS)
    return load_config(path, FaultScript)


def bound(script: FaultScript, known: Mapping[str, Fault]) -> list[Event]:
    """The script's faults as calls of the `known` ones; ConfigError names the nearest of a name or key unknown."""
    return [_event(number, entry, known) for number, entry in enumerate(script.faults, 1)]


def _event(number: int, entry: Entry, known: Mapping[str, Fault]) -> Event:
    if entry.name not in known:
        hint = suggestion_or_list(entry.name, known)
        raise ConfigError(f"[[faults]] {number}: no fault is called '{entry.name}'; {hint}")
    fault, given = known[entry.name], entry.model_extra or {}
    validate(given, _parameters(entry.name, fault), where=f"[[faults]] {number} ({entry.name})")
    told = ", ".join(f"{key} = {value}" for key, value in given.items())
    return Event(entry.at_s, f"{entry.name} {told}".rstrip(), partial(fault, **given))


def _parameters(name: str, fault: Fault) -> type[Section]:
    """What `fault` takes, as a table of a config file."""
    hints = get_type_hints(fault, include_extras=True)
    fields: dict[str, Any] = {
        key: (hints[key], ... if parameter.default is parameter.empty else parameter.default)
        for key, parameter in inspect.signature(fault).parameters.items()
    }
    return create_model(name, __base__=Section, **fields)
