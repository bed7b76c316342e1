"""Exclusive access to a line: two clients on one line would take each other's replies for their own.

A line is a serial port under its present name, a serial port behind a network address (`rtu+tcp`), or one unit of a
gateway (`tcp`). If the host of the address has several names, the line is locked under each name. The lock is an flock
on a file in the user's state folder. The kernel releases it when the process ends, also after a kill. The file names
the holder.

A driver shares its lock with its guardian, which inherits the open file: the line stays locked until both have released
it. After the end of its driver, a guardian holds the lock only during an attempt to switch off, so that a new driver or
`smadrive off` can use the line between two attempts.

If the folder cannot be written, there are no locks, because it must still be possible to switch a heater off.
"""

from __future__ import annotations

import os
import select
import time
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple, Self
from urllib.parse import quote

from smadrive.devices.state.folder import state_dir
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import BusyError, DataError, free_the_line
from smadrive.files.kinds import check_regular
from smadrive.posix import fcntl, released_in_children

GUARDIAN_WITHIN_S = 10.0
"""Longest time in seconds for which a guardian, or `smadrive off`, holds the line while it switches off."""
LOOK_AGAIN_S = 0.05
NO_DESCRIPTOR = -1


class Role(StrEnum):
    """The kind of process that holds a line."""

    DRIVER = "driver"
    GUARDIAN = "guardian"
    OFF = "off"


class Holder(NamedTuple):
    """The process that the file of a lock names. This process may have ended."""

    role: Role
    pid: int


class LineLock:
    """The lock of one line, held until `release` or the end of its `with` block.

    `descriptor` is the descriptor of the open lock file; NO_DESCRIPTOR without a file and after `release`.
    """

    def __init__(self, line: str, descriptor: int) -> None:
        self.line = line
        self.descriptor = descriptor
        _held.add(self)

    def hold_as(self, role: Role, pid: int) -> None:
        """Write role and process id of the holder into the file of the lock."""
        self._write(f"{role} {pid}\n")

    def release(self) -> None:
        """Release the line. If a guardian shares the lock, the guardian still has it. A second call does nothing.

        If the file names this process, the name is removed before the file is unlocked. Otherwise other programs could
        read it after the next process has locked the file and before that process has written its own name.
        """
        if self.descriptor != NO_DESCRIPTOR:
            holder = holder_of(self.line)
            if holder is not None and holder.pid == os.getpid():
                self._write("")
            os.close(self.descriptor)
            self.descriptor = NO_DESCRIPTOR

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()

    def _write(self, text: str) -> None:
        if self.descriptor != NO_DESCRIPTOR:
            with suppress(OSError):
                os.ftruncate(self.descriptor, 0)
                os.pwrite(self.descriptor, text.encode(), 0)


_held = released_in_children(LineLock.release)  # only the parent of a forked child is the driver


def lines_of(key: DeviceKey) -> tuple[str, ...]:
    """Return the names of a device's line: the present name of a serial port, or all names of a network port."""
    if key.port.startswith("serial:"):
        return (key.port,)
    unit = "" if key.unit_id is None or key.is_one_line else f" unit {key.unit_id}"
    return tuple(f"{name}{unit}" for name in sorted(key.names))


def lock_line(line: str, role: Role, within_s: float = GUARDIAN_WITHIN_S) -> LineLock:
    """Lock `line` and return the lock; BusyError, with the holder, if another process has it.

    Wait up to `within_s` for the lock. If a living driver has the lock, raise BusyError at once. If `role` is DRIVER
    and `smadrive off` has the lock, raise BusyError at once, too.
    """
    give_up_s = time.monotonic() + within_s
    while (lock := _try_lock(line)) is None:
        holder = holder_of(line)
        if _is_driving(holder) or _starts_during_off(role, holder) or time.monotonic() >= give_up_s:
            raise _busy(line, holder)
        time.sleep(LOOK_AGAIN_S)
    lock.hold_as(role, os.getpid())
    return lock


def check_free(line: str) -> None:
    """Raise BusyError, with the holder, if another process has locked `line` at this moment."""
    if _file(line).exists():
        lock = _try_lock(line)
        if lock is None:
            raise _busy(line, holder_of(line))
        lock.release()


def holder_of(line: str) -> Holder | None:
    """Return the holder that the lock file of `line` names; return None if it names none or cannot be read."""
    try:
        check_regular(_file(line), DataError)
        role, pid = _file(line).read_text(encoding="ascii").split()
        return Holder(Role(role), int(pid))
    except (OSError, ValueError, DataError):
        return None


def _file(line: str) -> Path:
    return state_dir() / "locks" / quote(line, safe="")[-200:]


def _try_lock(line: str) -> LineLock | None:
    """Lock the line and return the lock; return None if another process has it.

    If the file cannot be made or locked, return a lock without a file, which has no effect.
    """
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
    except OSError:  # the file system has no locks
        os.close(descriptor)
        return LineLock(line, NO_DESCRIPTOR)
    return LineLock(line, descriptor)


def _starts_during_off(role: Role, holder: Holder | None) -> bool:
    """Return True if this process is a driver that starts while `smadrive off` holds the line: it must not heat."""
    return role is Role.DRIVER and holder is not None and holder.role is Role.OFF


def _is_driving(holder: Holder | None) -> bool:
    """Return True if a living driver holds the line. Then waiting is useless, because a run may last for hours."""
    if holder is None or holder.role is not Role.DRIVER:
        return False
    return _lives(holder.pid)


def _lives(pid: int) -> bool:
    """Return True if the process has not ended. A zombie process has ended."""
    try:
        os.kill(pid, 0)
        descriptor = os.pidfd_open(pid)
    except ProcessLookupError:
        return False
    except (OSError, AttributeError):  # another user's process, or a system without process descriptors
        return True
    try:
        return not select.select((descriptor,), (), (), 0.0)[0]
    finally:
        os.close(descriptor)


def _busy(line: str, holder: Holder | None) -> BusyError:
    if holder is not None and holder.role is Role.GUARDIAN:
        return BusyError(
            f"busy, because a guardian (process {holder.pid}) has taken over from its driver and switches a device off",
            where=line,
            cure="end that driver if it still runs, and try again",
        )
    pid = None if holder is None else holder.pid
    name = "another smadrive" if pid is None else f"process {pid}"
    error = BusyError(f"busy, because {name} uses the port", where=line, cure=free_the_line(pid))
    error.holder_pid = pid
    return error
