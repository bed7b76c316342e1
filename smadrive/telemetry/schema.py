"""The published messages, version `VERSION`: their topics, fields and units. docs/telemetry.md describes them.

    PREFIX/RIG/schema        retained   the fields of all messages, with their units and meanings
    PREFIX/RIG/driver        retained   ONLINE, ENDED or GONE, as plain text; GONE is also the last will
    PREFIX/RIG/state         retained   what the driver does
    PREFIX/RIG/faults        retained   faults of the devices, and the fault that ended a run
    PREFIX/RIG/publisher     retained   the counts of the publisher
    PREFIX/RIG/sample                   one message for each tick
    PREFIX/RIG/off                      the only command; only if the rig file permits it

An unknown number is null, because JSON has no NaN. A field may be added without a new version; a field that is removed
or gets another meaning makes a new version.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Any, NamedTuple

from smadrive.runs.columns import COLUMNS as LOG_COLUMNS
from smadrive.stream.published_state import PublishedEnd, PublishedMode
from smadrive.stream.samples import COLUMNS

VERSION = 1

ONLINE, ENDED, GONE = "online", "ended", "gone"
"""The texts of the topic `driver`. GONE: the driver was killed, or the broker has lost the connection to it."""

DIGITS = 6
"""Numbers are rounded to this many decimal places. The error by rounding is below the noise of every sensor."""


class MessageField(NamedTuple):
    """One field of a message: `unit` as in a log file, empty for a field that is no number; `label` is the meaning."""

    unit: str
    label: str


SAMPLE = {
    "schema": MessageField("1", "version of the schema"),
    "number": MessageField("1", "number of the sample since the command began; a repeated number is the same sample"),
    "unix_s": MessageField("s", "time of the sample since 1970-01-01 UTC"),
    **{name: MessageField(LOG_COLUMNS[name].unit, LOG_COLUMNS[name].label) for name in COLUMNS},
}
STATE = {
    "schema": MessageField("1", "version of the schema"),
    "rig": MessageField("", "name of the rig"),
    "command": MessageField("", "command that runs"),
    "mode": MessageField(
        "",
        f"what the driver does: {', '.join(mode for mode in PublishedMode if mode is not PublishedMode.UNCONFIRMED)}; "
        f"'{PublishedMode.UNCONFIRMED}' when switching off has failed",
    ),
    "end": MessageField("", f"null during the command, then {' or '.join(PublishedEnd)}"),
    "limited_by": MessageField("", "limits that hold the output back now"),
    "rate_hz": MessageField("Hz", "rate of the loop"),
    "limits": MessageField("", "current_max_a and temperature_max_c of the rig file"),
    "devices": MessageField("", "type of each device by its name"),
}
FAULTS = {
    "schema": MessageField("1", "version of the schema"),
    "any": MessageField("", "true if there is a fault"),
    "fault": MessageField("", "fault that ended the run, as text; null without a fault"),
    "fault_type": MessageField("", "class of this fault, such as TripError"),
    "device_faults": MessageField("", "latched faults of the device"),
    "temperature_fault": MessageField("", "reason for an invalid temperature, such as an open thermocouple"),
    "supply_fault": MessageField("", "reason for an invalid current or voltage"),
    "latched": MessageField("", "latched trip, also of an earlier run, which keeps the rig from heating"),
}
PUBLISHER = {
    "schema": MessageField("1", "version of the schema"),
    "samples": MessageField("1", "samples that the broker has confirmed"),
    "dropped": MessageField("1", "samples that were overwritten before they could be sent"),
    "waiting": MessageField("1", "samples that are not confirmed yet"),
    "connections": MessageField("1", "connections to the broker since the command began"),
}
MESSAGES: dict[str, Mapping[str, MessageField]] = {
    "sample": SAMPLE,
    "state": STATE,
    "faults": FAULTS,
    "publisher": PUBLISHER,
}
"""The fields of each message by its topic."""


def topic_of(prefix: str, rig: str, message: str) -> str:
    """Return the topic of a message. Spaces and special characters of the rig's name become `-`."""
    name = re.sub(r"[^\w.-]+", "-", rig).strip("-") or "rig"
    return f"{prefix}/{name}/{message}"


def schema_document() -> dict[str, Any]:
    """Return the table of all fields, which is published at the topic `schema`."""
    fields = {topic: {name: field._asdict() for name, field in message.items()} for topic, message in MESSAGES.items()}
    return {"schema": VERSION, "messages": fields}


def sample_message(number: int, began_unix_s: float, values: Iterable[float]) -> dict[str, Any]:
    """Return the message of one row. `number` is the number of the row, `values` are the values of `COLUMNS`.

    `began_unix_s` is the Unix time at which `time_s` is 0. A value that is not finite becomes None.
    """
    row = dict(zip(COLUMNS, (_number(value) for value in values), strict=True))
    return {"schema": VERSION, "number": number, "unix_s": round(began_unix_s + (row["time_s"] or 0.0), 3), **row}


def state_message(status: Mapping[str, Any], command: str) -> dict[str, Any]:
    """Return the message about what the driver does, from the status that the loop publishes."""
    chosen = {name: status.get(name) for name in STATE if name in status}
    return {"schema": VERSION, "command": command, **chosen}


def faults_message(status: Mapping[str, Any]) -> dict[str, Any]:
    """Return the message about the faults, from the status that the loop publishes."""
    chosen = {name: status.get(name) for name in FAULTS if name in status}
    return {"schema": VERSION, "any": any(chosen.values()), **chosen}


def _number(value: float) -> float | None:
    return round(float(value), DIGITS) if isfinite(value) else None
