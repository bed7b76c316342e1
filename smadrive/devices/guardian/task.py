"""What a driver and its guardian say to each other: the task, as the first line of a pipe, then single bytes."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

from smadrive.devices.identity import Identity

WATCH, HEARTBEAT, STAND_DOWN, GIVES_WAY = b"w", b"b", b"r", b"g"
READY, ECHO, TAKEN, FREE = b"y", b"e", b"t", b"f"


@dataclass(frozen=True)
class GuardedDevice:
    """The device to bring to its safe state, as the rig file names it."""

    profile: str
    url: str
    unit_id: int | None
    identity: Identity = field(default_factory=dict)
    """What the driver found it to be: no other confirms anything."""


class SharedLock(NamedTuple):
    """A lock that the driver has of its line, inherited as an open file."""

    line: str
    descriptor: int


@dataclass(frozen=True)
class Task:
    """What the guardian is told at its start."""

    device: GuardedDevice
    timeout_s: float
    locks: tuple[SharedLock, ...] = ()

    def to_json(self) -> bytes:
        """One line."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_json(cls, line: bytes) -> Task:
        """What `to_json` wrote."""
        task = json.loads(line)
        locks = tuple(SharedLock(*lock) for lock in task["locks"])
        return cls(GuardedDevice(**task["device"]), task["timeout_s"], locks)
