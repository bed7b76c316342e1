"""Exclusive access to a line: two clients on one line would take each other's replies for their own.

A line is a serial port under its present name, or one unit behind a network address; a line behind a host with several
names is locked under each. Its lock is an flock on a file in the user's state folder; the kernel releases it when the
process ends, also after a kill. The file names the holder. A driver shares its lock with its guardian, which inherits
the open file: they hold the line until both have released it. A guardian whose driver has ended holds the lock only
during an attempt to switch off, so that a new driver or `smadrive off` can use the line between two attempts.
`smadrive off` locks the line too: a second one waits for it.

Where the folder cannot be written there are no locks: it must still be possible to switch a heater off.
"""

from __future__ import annotations

import fcntl
import os
import time
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple, Self
from urllib.parse import quote

from smadrive.devices.state.folder import state_dir
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import BusyError, DataError
from smadrive.files.kinds import check_regular

GUARDIAN_WITHIN_S = 10.0
"""Longest time for which a guardian, or `smadrive off`, holds the line during an attempt to switch off."""
LOOK_AGAIN_S = 0.05
NO_DESCRIPTOR = -1


class Role(StrEnum):
    """The holder of a line: a driver, a guardian, or `smadrive off`."""

    DRIVER = "driver"
    GUARDIAN = "guardian"
    OFF = "off"


class Holder(NamedTuple):
    """The process that a lock's file names; it may have ended since."""

    role: Role
    pid: int


class LineLock:
    """The lock of one line, held until `release`; a context manager. `descriptor` is that of its file."""

    def __init__(self, line: str, descriptor: int) -> None:
        self.line = line
        self.descriptor = descriptor

    def hold_as(self, role: Role, pid: int) -> None:
        """Name the holder in the file."""
        if self.descriptor != NO_DESCRIPTOR:
            with suppress(OSError):
                os.ftruncate(self.descriptor, 0)
                os.pwrite(self.descriptor, f"{role} {pid}\n".encode(), 0)

    def release(self) -> None:
        """Release the line; a guardian that shares the lock keeps it. Releasing twice does no harm."""
        if self.descriptor != NO_DESCRIPTOR:
            os.close(self.descriptor)
            self.descriptor = NO_DESCRIPTOR

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()


def lines_of(key: DeviceKey) -> tuple[str, ...]:
    """The line of a device: a serial port under its present name, or one unit of a network port under each name."""
    if key.port.startswith("serial:"):
        return (key.port,)
    unit = "" if key.unit_id is None else f" unit {key.unit_id}"
    return tuple(f"{name}{unit}" for name in sorted(key.names))


def lock_line(line: str, role: Role, within_s: float = GUARDIAN_WITHIN_S) -> LineLock:
    """Return the lock of `line`; wait up to `within_s` for a guardian or `smadrive off` at work there.

    BusyError names the holder.
    """
    give_up_s = time.monotonic() + within_s
    while (lock := _try_lock(line)) is None:
        holder = holder_of(line)
        if _is_driving(holder) or time.monotonic() >= give_up_s:
            raise _busy(line, holder)
        time.sleep(LOOK_AGAIN_S)
    lock.hold_as(role, os.getpid())
    return lock


def holder_of(line: str) -> Holder | None:
    """The holder that the file of the lock names; None: it names none."""
    try:
        check_regular(_file(line), DataError)
        role, pid = _file(line).read_text(encoding="ascii").split()
        return Holder(Role(role), int(pid))
    except (OSError, ValueError, DataError):
        return None


def _file(line: str) -> Path:
    return state_dir() / "locks" / quote(line, safe="")[-200:]


def _try_lock(line: str) -> LineLock | None:
    """The lock; one without a file where none can be made; None: another process holds it."""
    file = _file(line)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        return LineLock(line, NO_DESCRIPTOR)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError:  # a file system without locks
        os.close(descriptor)
        return LineLock(line, NO_DESCRIPTOR)
    return LineLock(line, descriptor)


def _is_driving(holder: Holder | None) -> bool:
    """Whether a living driver holds the line; waiting is useless, it may last for hours."""
    if holder is None or holder.role is not Role.DRIVER:
        return False
    try:
        os.kill(holder.pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _busy(line: str, holder: Holder | None) -> BusyError:
    if holder is not None and holder.role is Role.GUARDIAN:
        return BusyError(
            f"busy, a guardian (process {holder.pid}) has taken over from its driver and switches off a device there",
            where=line,
            cure="end that driver if it still lives, and try again",
        )
    name, kill = "another smadrive", "`kill` of it"
    if holder is not None:
        name, kill = f"process {holder.pid}", f"`kill {holder.pid}`"
    return BusyError(
        f"busy, {name} holds the port",
        where=line,
        cure="close it. A smadrive that runs or tunes there switches the heater off at `smadrive off RIG`, at Ctrl-C "
        f"in its terminal, at {kill}, or at OFF (POST /off) of its page",
    )
