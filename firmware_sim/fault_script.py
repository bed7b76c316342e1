"""FAULTS.toml: the faults of a simulated bench, each at its time.

    [[faults]]              # one fault
    at_s = 12.0             # the time of the bench at which the fault begins
    name = "delay"          # the method of the bench that begins the fault
    delay_s = 0.3           # this key and the next key are parameters of the method
    replies = 5             # or for_s = 2.0

    [random]                # random faults of the bus, in addition; the seed is the simulator's seed
    share = 0.1             # fraction of the replies with a fault
    slowest_s = 0.5         # the longest delay, pause or absence
    copies = true           # a copy of a reply may arrive after the next request; plain RTU cannot detect this copy
    lag = true              # replies may repeat the previous reply; RTU and Modbus TCP cannot detect this

A test calls the same methods, so a script can cause the same faults as a test.
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

FaultMethod = Callable[..., None]
_ROUNDING_S = 1e-9


class RandomConfig(Section):
    """The table [random] of a FAULTS.toml: random faults of the bus."""

    share: float = Field(gt=0, le=1)
    slowest_s: float = Field(default=0.5, gt=0)
    copies: bool = False
    lag: bool = False


class FaultEntry(Section):
    """One fault. Its keys besides `at_s` and `name` are the parameters of the method `name`."""

    model_config = ConfigDict(extra="allow")

    at_s: float = Field(ge=0)
    name: str


class FaultScript(Section):
    """The content of a FAULTS.toml."""

    faults: tuple[FaultEntry, ...] = ()
    random: RandomConfig | None = None


class ScheduledFault(NamedTuple):
    """A fault with its parameters, and the time at which it begins."""

    at_s: float
    text: str
    begin: Callable[[], None]


class Timeline:
    """The faults of a script that have not begun yet, in the order of their times."""

    def __init__(
        self, faults: Sequence[ScheduledFault] = (), log_event: Callable[[str], None] = lambda _text: None
    ) -> None:
        """`log_event` gets a line per fault that begins."""
        self._coming = deque(sorted(faults, key=lambda fault: fault.at_s))
        self._log_event = log_event

    def advance_to(self, time_s: float) -> None:
        """Begin every fault that is due at `time_s`."""
        while self._coming and self._coming[0].at_s <= time_s + _ROUNDING_S:
            fault = self._coming.popleft()
            self._log_event(f"fault: {fault.text}")
            fault.begin()


def load_script(path: Path) -> FaultScript:
    """Load the script at `path`. ConfigError when the file is missing or wrong; it names file, key and cure."""
    check_kind(path, FAULTS)
    return load_config(path, FaultScript)


def scheduled(script: FaultScript, methods: Mapping[str, FaultMethod]) -> list[ScheduledFault]:
    """Return the faults of the script. `methods` has every method of the bench that a script can call, by name.

    ConfigError for an unknown name or key, a missing key, or a wrong value. For an unknown name or key, the error
    suggests the known one with the most similar spelling.
    """
    return [_scheduled(f"[[faults]] {number}", entry, methods) for number, entry in enumerate(script.faults, 1)]


def _scheduled(where: str, entry: FaultEntry, methods: Mapping[str, FaultMethod]) -> ScheduledFault:
    if entry.name not in methods:
        raise ConfigError(
            f"no fault is called '{entry.name}'", where=where, cure=suggestion_or_list(entry.name, methods)
        )
    method, parameters = methods[entry.name], entry.model_extra or {}
    validate(parameters, _parameter_table(entry.name, method), where=f"{where} ({entry.name})")
    text = ", ".join(f"{key} = {value}" for key, value in parameters.items())
    return ScheduledFault(entry.at_s, f"{entry.name} {text}".rstrip(), partial(method, **parameters))


def _parameter_table(name: str, method: FaultMethod) -> type[Section]:
    """Return a Section whose keys are the parameters of `method`, with their types and defaults."""
    hints = get_type_hints(method, include_extras=True)
    fields: dict[str, Any] = {
        key: (hints[key], ... if parameter.default is parameter.empty else parameter.default)
        for key, parameter in inspect.signature(method).parameters.items()
    }
    return create_model(name, __base__=Section, **fields)
