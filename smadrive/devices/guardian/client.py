"""The driver's end of the guardian: starts it, keeps it informed, gives way to it when it has taken over."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
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
"""So many times its own patience with the driver is the driver's with it."""
MANY = 4096
GONE = "the guardian is gone or stands still: heating without it is refused"


class GuardianClient:
    """A guardian process for `task`, a context manager: leaving it ends the guardian, unless heat may still flow.

    `give_way` lets all connections of the driver go: some devices have room for one only, and it may be the guardian's.
    """

    def __init__(self, task: Task, give_way: Callable[[], None]) -> None:
        self._task = task
        self._give_way = give_way
        self._locks: list[LineLock] = []
        self._watching = False
        self._taken = False
        self._gone = False
        self._heard_s = 0.0

    def share(self, locks: Iterable[LineLock]) -> None:
        """Let the guardian inherit the locks of the line, before it is started."""
        self._locks = [lock for lock in locks if lock.descriptor != NO_DESCRIPTOR]

    def __enter__(self) -> Self:
        """Start the guardian, which comes up while the driver connects."""
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                "smadrive.devices.guardian.process",
            ],  # -P: no file of the present folder runs instead
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is the driver's
            pass_fds=[lock.descriptor for lock in self._locks],
        )
        self._to, self._from = _piped(self._process.stdin), _piped(self._process.stdout)
        return self

    def configure(self, identity: Identity) -> None:
        """Tell the guardian which device it guards, which is confirmed off now, and wait until it is ready.

        Guardians of earlier runs that wait for this very device end. SafetyError when the guardian does not come up.
        """
        device = replace(self._task.device, identity=dict(identity))
        profile = load_profile(device.profile)
        relieve(key_at(device.url, profile, device.unit_id).with_identity(profile, identity))
        shared = tuple(SharedLock(lock.line, lock.descriptor) for lock in self._locks)
        with suppress(OSError):  # told below
            self._to.write(replace(self._task, device=device, locks=shared).to_json())
        ready, _, _ = select.select((self._from,), (), (), STARTS_WITHIN_S)
        if not ready or self._from.read(1) != READY:
            self._process.kill()
            raise SafetyError(
                "the guardian did not start: heating a source without a watchdog is refused without it; is smadrive "
                "installed, or on PYTHONPATH?"
            )
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes: the guardian ends, at once when the source is confirmed off."""
        self._to.close()
        self._from.close()
        if self._watching:
            return
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:  # it stands still, and is not needed any more
            self._end()

    def watch(self) -> None:
        """Heating begins; SafetyError when nobody is there to watch."""
        self._from.read(MANY)  # of the last watch
        self._heard_s = time.monotonic()
        if not self._told(WATCH):
            raise SafetyError(GONE)
        self._watching = True

    def heartbeat(self) -> None:
        """The driver lives and is about to use a port, or has just used it.

        TakenOverError when the guardian has the ports.
        """
        if self._watching:
            heard = self._from.read(MANY)  # None: nothing new, empty: nobody there
            self._gone = heard == b""
            if TAKEN in (heard or b""):
                self._taken = True
                self._give_way()
                self._told(GIVES_WAY)
            if self._taken:
                raise TakenOverError(
                    f"the driver stood still for more than {self._task.timeout_s:g} s and the guardian has taken over"
                )
            if heard:
                self._heard_s = time.monotonic()
            self._told(HEARTBEAT)

    def check(self) -> None:
        """The driver is about to command: SafetyError when the guardian does not answer any more; as of `heartbeat`."""
        self.heartbeat()
        if self._watching and (self._gone or time.monotonic() - self._heard_s > PATIENCE * self._task.timeout_s):
            raise SafetyError(GONE)

    def take_back(self) -> None:
        """Where the guardian has taken over, let it end its work, and have the ports again.

        SafetyError when it does not come to an end; it goes on then.
        """
        if self._taken:
            if not self._freed():
                raise SafetyError("the guardian has taken over, and could not confirm yet that the heater is off")
            self._taken = self._watching = False

    def stand_down(self) -> None:
        """The driver has confirmed the source off; should the guardian come in this moment, it is awaited."""
        if self._watching:
            self._watching = self._taken = False
            if not self._freed():
                self._end()  # it stands still, and would wake up beside another program at the ports

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _freed(self) -> bool:
        """Ask the guardian for the ports and await them; one that is gone has left them."""
        give_up_s = time.monotonic() + FREES_WITHIN_S
        self._told(STAND_DOWN)
        while (left_s := give_up_s - time.monotonic()) > 0:
            select.select((self._from,), (), (), left_s)
            heard = self._from.read(MANY)
            if heard == b"" or FREE in (heard or b""):
                return True
        return False

    def _told(self, what: bytes) -> bool:
        """Whether it could be told: it may be gone, or stand still."""
        with suppress(OSError):
            return bool(self._to.write(what))
        return False


def _piped(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None  # both ends are pipes
    return end
