"""The messages between a driver and its guardian: first the task, as one line of JSON, then single bytes."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from math import inf
from typing import NamedTuple

from smadrive.devices.identity import Identity

WATCH, HEARTBEAT, STAND_DOWN, GIVES_WAY, HAND_OVER = b"w", b"b", b"r", b"g", b"h"
READY, ECHO, TAKEN, FREE = b"y", b"e", b"t", b"f"


@dataclass(frozen=True)
class GuardedDevice:
    """The device that the guardian switches off, with the values of its entry in the rig file.

    A measured current up to a tenth of `current_max_a`, and up to 50 mA at most, counts as zero.
    """

    profile: str
    url: str
    unit_id: int | None
    identity: Identity = field(default_factory=dict)
    """The identity that the driver has proved. Only a device with this identity can confirm the safe state."""
    current_max_a: float = inf


class SharedLock(NamedTuple):
    """A lock of the driver's line, which the guardian inherits as an open file."""

    line: str
    descriptor: int


@dataclass(frozen=True)
class Task:
    """The task that the driver sends at the start.

    device       the device to switch off
    timeout_s    longest silence of the driver in seconds, after which the guardian takes over
    locks        the locks of the line that driver and guardian share
    """

    device: GuardedDevice
    timeout_s: float
    locks: tuple[SharedLock, ...] = ()

    def to_json(self) -> bytes:
        """Return the task as one line of JSON."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_json(cls, line: bytes) -> Task:
        """Return the task from a line that `to_json` wrote."""
        task = json.loads(line)
        locks = tuple(SharedLock(*lock) for lock in task["locks"])
        return cls(GuardedDevice(**task["device"]), task["timeout_s"], locks)
