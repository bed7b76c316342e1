"""The driver's end of the guardian: starts it, sends it heartbeats, frees the ports when it has taken over.

STANDING_BY    the guardian does not watch: nothing heats, or the source is confirmed off
WATCHED        the guardian watches: the driver heats and sends heartbeats
TAKEN_OVER     the driver was silent for too long: the guardian uses the ports
"""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from enum import Enum, auto
from types import TracebackType
from typing import IO, Self

from smadrive.devices.guardian.duty import relieve
from smadrive.devices.guardian.task import FREE, GIVES_WAY, HEARTBEAT, READY, STAND_DOWN, TAKEN, WATCH, SharedLock, Task
from smadrive.devices.identity import Identity
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import NO_DESCRIPTOR, LineLock
from smadrive.errors import SafetyError, TakenOverError

STARTS_WITHIN_S = 20.0
ENDS_WITHIN_S = 5.0
FREES_WITHIN_S = 5.0
PATIENCE = 2.0
"""The driver waits for an answer of the guardian so many times as long as the guardian waits for the driver."""
MANY = 4096
COMMAND = (sys.executable, "-P", "-m", "smadrive.devices.guardian.process")
"""-P: no file of the present folder runs instead."""


class WatchState(Enum):
    """The state of the guardian as the driver knows it; see the head of this file."""

    STANDING_BY = auto()
    WATCHED = auto()
    TAKEN_OVER = auto()


class GuardianClient:
    """A guardian process for `task`, a context manager: leaving it ends the guardian, unless heat may still flow.

    `give_way` closes all connections of the driver: some devices accept one only, and the guardian may need it.
    """

    def __init__(self, task: Task, give_way: Callable[[], None]) -> None:
        self._task = task
        self._give_way = give_way
        self._locks: list[LineLock] = []
        self._state = WatchState.STANDING_BY
        self._gone = False
        self._answered_s = 0.0

    def share(self, locks: Iterable[LineLock]) -> None:
        """Let the guardian inherit the locks of the line, before it is started."""
        self._locks = [lock for lock in locks if lock.descriptor != NO_DESCRIPTOR]

    def __enter__(self) -> Self:
        """Start the guardian, which comes up while the driver connects."""
        self._process = subprocess.Popen(
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is for the driver
            pass_fds=[lock.descriptor for lock in self._locks],
        )
        self._to, self._from = _piped(self._process.stdin), _piped(self._process.stdout)
        return self

    def configure(self, identity: Identity) -> None:
        """Send the guardian its task, with the identity of the device, which is confirmed off; wait until it is ready.

        Guardians of earlier runs that wait for this very device end. SafetyError when the guardian does not come up.
        """
        device = replace(self._task.device, identity=dict(identity))
        profile = load_profile(device.profile)
        relieve(key_at(device.url, profile, device.unit_id).with_identity(profile, identity))
        shared = tuple(SharedLock(lock.line, lock.descriptor) for lock in self._locks)
        with suppress(OSError):  # then READY does not come either
            self._to.write(replace(self._task, device=device, locks=shared).to_json())
        ready, _, _ = select.select((self._from,), (), (), STARTS_WITHIN_S)
        if not ready or self._from.read(1) != READY:
            self._process.kill()
            raise SafetyError(
                "did not start, and without it a source without a watchdog must not heat",
                where="guardian",
                cure="install smadrive, or set PYTHONPATH to it",
            )
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes: the guardian ends, at once when the source is confirmed off."""
        self._to.close()
        self._from.close()
        if self._state is not WatchState.STANDING_BY:
            return
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:  # it stands still, and is not needed any more
            self._end()

    def watch(self) -> None:
        """Tell the guardian that heating begins; SafetyError when it is gone."""
        self._from.read(MANY)  # answers of the last watch
        self._answered_s = time.monotonic()
        if not self._send(WATCH):
            raise _gone()
        if self._state is WatchState.STANDING_BY:  # a take-over ends by `take_back` alone
            self._state = WatchState.WATCHED

    def heartbeat(self) -> None:
        """Send a heartbeat, before and after every use of a port; TakenOverError when the guardian has the ports."""
        if self._state is WatchState.STANDING_BY:
            return
        answer = self._from.read(MANY)  # None: nothing new, empty: the guardian is gone
        self._gone = answer == b""
        if TAKEN in (answer or b""):
            self._state = WatchState.TAKEN_OVER
            self._give_way()
            self._send(GIVES_WAY)
        if self._state is WatchState.TAKEN_OVER:
            raise TakenOverError(
                "the guardian has taken over, because the driver stood still", limit=f"{self._task.timeout_s:g} s"
            )
        if answer:
            self._answered_s = time.monotonic()
        self._send(HEARTBEAT)

    def check(self) -> None:
        """Send a heartbeat before a command; SafetyError when the guardian does not answer any more."""
        self.heartbeat()
        silent_s = time.monotonic() - self._answered_s
        if self._state is WatchState.WATCHED and (self._gone or silent_s > PATIENCE * self._task.timeout_s):
            raise _gone()

    def take_back(self) -> None:
        """After a take-over, let the guardian end its work, and have the ports again.

        SafetyError when it does not come to an end; it goes on then.
        """
        if self._state is WatchState.TAKEN_OVER:
            if not self._is_freed():
                raise SafetyError("the guardian has taken over, and could not confirm yet that the heater is off")
            self._state = WatchState.STANDING_BY

    def stand_down(self) -> None:
        """End the watch after the driver has confirmed the source off; a guardian that takes over now is awaited."""
        if self._state is not WatchState.STANDING_BY:
            self._state = WatchState.STANDING_BY
            if not self._is_freed():
                self._end()  # it stands still: when it wakes it would use the ports beside another program

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _is_freed(self) -> bool:
        """Ask the guardian for the ports and wait for them; a guardian that is gone has left them."""
        give_up_s = time.monotonic() + FREES_WITHIN_S
        self._send(STAND_DOWN)
        while (left_s := give_up_s - time.monotonic()) > 0:
            select.select((self._from,), (), (), left_s)
            answer = self._from.read(MANY)
            if answer == b"" or FREE in (answer or b""):
                return True
        return False

    def _send(self, signal: bytes) -> bool:
        """Whether the signal could be written; the guardian may be gone, or stand still."""
        with suppress(OSError):
            return bool(self._to.write(signal))
        return False


def _gone() -> SafetyError:
    return SafetyError("is gone or stands still, and without it the source must not heat", where="guardian")


def _piped(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None  # both ends are pipes
    return end
