"""The events of a tuning session that a program reads back: modes, tunings in force, and the texts of their models.

The text of an event has a fixed length in a log, so the text of a model is stored in several events:

    mode: tracking
    model 2, part 1 of 4: {"schema": …
    in force: mu_heating, model 2: mu_heating = 90.5, …
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from smadrive.runs.log.layout import EVENT_BYTES
from smadrive.runs.log.reader import Log, RunEvent
from smadrive.safety.shutdown import off_text

_MODE = "mode: "
_PART_BYTES = EVENT_BYTES - 40
_PART = re.compile(r"model (\d+), part (\d+) of (\d+): (.*)", re.DOTALL)
_CYCLE = re.compile(r"cycle \d+: ")
_TRIP = re.compile(r"fault \d+: ")
_IN_FORCE = re.compile(r"in force: (.*), model (\d+): (.*)", re.DOTALL)


class PutInForce(NamedTuple):
    """A tuning that was put in force.

    time_s    time of the event, s
    change    name of the change that gave the tuning
    model     number of the model in the log, see `models_of`
    values    values of the tuning, as text
    """

    time_s: float
    change: str
    model: int
    values: str


class Span(NamedTuple):
    """An interval of time in which the session was in one mode."""

    from_s: float
    to_s: float
    mode: str


def mode_event(mode: str) -> str:
    """Return the text of the event for a new mode."""
    return f"{_MODE}{mode}"


def session_ended_event(*, confirmed: bool) -> str:
    """Return the text of the last event of a session. `confirmed`: read-back confirmed the heater off."""
    return f"session ended: {off_text(confirmed=confirmed)}"


def in_force_event(change: str, model: int, values: Mapping[str, object]) -> str:
    """Return the text of the event for a tuning that was put in force."""
    texts = (
        f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}" for name, value in values.items()
    )
    return f"in force: {change[:80]}, model {model}: {', '.join(texts)}"


def model_events(number: int, text: str) -> list[str]:
    """Split the JSON `text` of model `number` into parts, and return the text of one event for each part."""
    compact = json.dumps(json.loads(text), separators=(",", ":"))  # ASCII: a character is a byte
    parts = [compact[at : at + _PART_BYTES] for at in range(0, len(compact), _PART_BYTES)]
    return [f"model {number}, part {n} of {len(parts)}: {part}" for n, part in enumerate(parts, 1)]


def models_of(log: Log) -> dict[int, str]:
    """Return the models in a session's log: model number to JSON text. A model with a missing part is left out."""
    parts: dict[int, dict[int, str]] = {}
    totals: dict[int, int] = {}
    for event in log.events:
        if (match := _PART.fullmatch(event.message)) is not None:
            number, part, total = (int(match[group]) for group in (1, 2, 3))
            parts.setdefault(number, {})[part] = match[4]
            totals[number] = total
    whole = {number: found for number, found in parts.items() if set(found) == set(range(1, totals[number] + 1))}
    return {number: "".join(found[part] for part in sorted(found)) for number, found in whole.items()}


def tunings_of(log: Log) -> list[PutInForce]:
    """Return the tunings that were put in force, in their order. The first is the tuning at the start."""
    found = ((event.time_s, _IN_FORCE.fullmatch(event.message)) for event in log.events)
    return [PutInForce(time_s, match[1], int(match[2]), match[3]) for time_s, match in found if match is not None]


def spans_of(log: Log) -> Iterator[Span]:
    """Yield one span for each mode event, in order. The last span ends at the last row of the log."""
    end_s = float(log.column("time_s")[-1])
    marks = [event for event in log.events if event.message.startswith(_MODE)]
    ends = [*(event.time_s for event in marks[1:]), end_s]
    for mark, to_s in zip(marks, ends, strict=False):
        yield Span(mark.time_s, max(to_s, mark.time_s), mark.message.removeprefix(_MODE))


def trips_of(log: Log) -> list[RunEvent]:
    """Return the trips of a session, in their order. There may be several: the user may clear a trip and go on."""
    return [event for event in log.events if _TRIP.match(event.message)]


def plain_events(log: Log) -> list[RunEvent]:
    """Return the events without parts of models and metrics of cycles. A report has a table of these metrics."""
    return [event for event in log.events if not (_PART.fullmatch(event.message) or _CYCLE.match(event.message))]
