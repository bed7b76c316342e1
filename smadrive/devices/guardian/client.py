"""The driver's client of the guardian: it starts the guardian, sends heartbeats, and ends a take-over."""

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
from weakref import WeakSet

from smadrive.devices.guardian.duty import relieve
from smadrive.devices.guardian.states import REASONS, WatchState
from smadrive.devices.guardian.task import (
    FREE,
    GIVES_WAY,
    HAND_OVER,
    HEARTBEAT,
    READY,
    STAND_DOWN,
    TAKEN,
    WATCH,
    SharedLock,
    Task,
)
from smadrive.devices.identity import Identity
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import NO_DESCRIPTOR, LineLock
from smadrive.errors import SafetyError, TakenOverError
from smadrive.posix import released_in_children

STARTS_WITHIN_S = 20.0
ENDS_WITHIN_S = 5.0
FREES_WITHIN_S = 5.0
TAKES_WITHIN_S = 1.0
PATIENCE = 2.0
"""The driver waits `PATIENCE * timeout_s` for an answer of the guardian, which takes over after `timeout_s`."""
MANY = 4096
COMMAND = (sys.executable, "-P", "-m", "smadrive.devices.guardian.process")
"""The command that starts a guardian. With -P, no file in the working directory can replace the module."""


class GuardianClient:
    """A guardian process for `task`. The end of this context manager ends the guardian, unless current may still flow.

    At a take-over or a hand-over, `give_way` is called. It must close all connections of the driver: some devices
    accept only one connection, and the guardian may need it.
    """

    def __init__(self, task: Task, give_way: Callable[[], None]) -> None:
        self._task = task
        self._give_way = give_way
        self._locks: list[LineLock] = []
        self._state = WatchState.STANDING_BY
        self._gone = False
        self._answered_s = 0.0

    def share(self, locks: Iterable[LineLock]) -> None:
        """Set the locks of the line that the guardian inherits. Call this before the guardian starts."""
        self._locks = [lock for lock in locks if lock.descriptor != NO_DESCRIPTOR]

    def __enter__(self) -> Self:
        """Start the guardian. It gets ready while the driver connects."""
        self._process = subprocess.Popen(
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if sys.stderr is None else None,  # otherwise its port gets this descriptor
            bufsize=0,
            start_new_session=True,  # Ctrl-C must end the driver only
            pass_fds=[lock.descriptor for lock in self._locks],
        )
        self._to, self._from = _piped(self._process.stdin), _piped(self._process.stdout)
        _clients.add(self)
        return self

    def configure(self, identity: Identity) -> None:
        """Send the guardian its task with the identity of the device, and wait until the guardian is ready.

        The device must be confirmed off before this call, because the call ends the guardians of earlier runs that
        still wait for this device. SafetyError when the guardian does not start.
        """
        device = replace(self._task.device, identity=dict(identity))
        profile = load_profile(device.profile)
        relieve(key_at(device.url, profile, device.unit_id).with_identity(profile, identity))
        shared = tuple(SharedLock(lock.line, lock.descriptor) for lock in self._locks)
        with suppress(OSError):  # after a failed write the guardian does not send READY: SafetyError below
            self._to.write(replace(self._task, device=device, locks=shared).to_json())
        ready, _, _ = select.select((self._from,), (), (), STARTS_WITHIN_S)
        if not ready or self._from.read(1) != READY:
            self._process.kill()
            raise SafetyError(
                "the guardian did not start, and a source without a watchdog must not heat without a guardian",
                where="guardian",
                cure="install smadrive, or set PYTHONPATH to it",
            )
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes. The guardian then ends, but first switches the source off if it is not confirmed off."""
        self._to.close()
        self._from.close()
        if self._state is not WatchState.STANDING_BY:
            return
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:  # the guardian stands still, and is not needed any more
            self._end()

    def close_inherited(self) -> None:
        """Close the pipes in a forked child: the guardian must notice the end of the driver, not of the child."""
        self._to.close()
        self._from.close()
        self._state = WatchState.STANDING_BY

    def watch(self) -> None:
        """Tell the guardian that heating begins; SafetyError when the guardian is gone."""
        self._from.read(MANY)  # drops the answers of the previous watch
        self._answered_s = time.monotonic()
        if not self._send(WATCH):
            raise _gone()
        if self._state is WatchState.STANDING_BY:  # only `take_back` ends a take-over
            self._state = WatchState.WATCHED

    def heartbeat(self) -> None:
        """Send a heartbeat if the guardian watches.

        Call this before every use of a port (see `PortAccess`). TakenOverError if the guardian uses the ports.
        """
        if self._state is WatchState.STANDING_BY:
            return
        answer = self._from.read(MANY)  # None if there is no answer, empty if the guardian has ended
        self._gone = answer == b""
        if TAKEN in (answer or b""):
            self._state = WatchState.TAKEN_OVER
            self._give_way()
            self._send(GIVES_WAY)
        if (reason := REASONS.get(self._state)) is not None:
            raise TakenOverError(f"the guardian has taken over, because {reason}")
        if answer:
            self._answered_s = time.monotonic()
        self._send(HEARTBEAT)

    def check(self) -> None:
        """Send a heartbeat before a command; SafetyError when the guardian no longer answers."""
        self.heartbeat()
        silent_s = time.monotonic() - self._answered_s
        if self._state is WatchState.WATCHED and (self._gone or silent_s > PATIENCE * self._task.timeout_s):
            raise _gone()

    def hand_over(self) -> bool:
        """Close the connections and let the guardian switch off, because the driver could not.

        Return True if the guardian has taken over; then no heartbeat keeps it from the device, which it may find at
        another port. Return False if it does not watch, has ended, or does not answer within `TAKES_WITHIN_S`.
        """
        if self._state is not WatchState.WATCHED:
            return False
        self._give_way()
        if self._is_answered(HAND_OVER, TAKEN, TAKES_WITHIN_S):
            self._state = WatchState.HANDED_OVER
        return self._state is WatchState.HANDED_OVER

    def take_back(self) -> None:
        """After a take-over or a hand-over, wait until the guardian has finished, and get the ports back.

        SafetyError when the guardian does not finish in time. The guardian then continues its attempts to switch off.
        """
        if self._state in REASONS:
            if not self._is_freed():
                raise SafetyError(
                    "the guardian has taken over and could not confirm yet that the heater is off",
                    where="guardian",
                    limit=f"{FREES_WITHIN_S:g} s",
                    cure="cut the supply of the heater",
                )
            self._state = WatchState.STANDING_BY

    def stand_down(self) -> None:
        """End the watch after the driver has confirmed the source off.

        If the guardian is taking over at this moment, wait until it has finished; after `FREES_WITHIN_S` kill it.
        """
        if self._state is not WatchState.STANDING_BY:
            self._state = WatchState.STANDING_BY
            if not self._is_freed():
                self._end()  # the guardian stands still: later it could use the ports while another program uses them

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _is_freed(self) -> bool:
        """Ask the guardian for the ports. Return True when they are free, False after `FREES_WITHIN_S`.

        If the guardian process has ended, the ports are free, too.
        """
        return self._is_answered(STAND_DOWN, FREE, FREES_WITHIN_S) or self._gone

    def _is_answered(self, request: bytes, answer: bytes, within_s: float) -> bool:
        """Send a request, and return True after the answer. Return False if none arrives, or the guardian has ended."""
        give_up_s = time.monotonic() + within_s
        self._send(request)
        while (left_s := give_up_s - time.monotonic()) > 0:
            select.select((self._from,), (), (), left_s)
            received = self._from.read(MANY)
            self._gone = received == b""
            if self._gone or answer in (received or b""):
                return not self._gone
        return False

    def _send(self, signal: bytes) -> bool:
        """Write a signal and return True if that succeeded. The guardian may be gone or stand still."""
        with suppress(OSError):
            return bool(self._to.write(signal))
        return False


_clients: WeakSet[GuardianClient] = released_in_children(lambda one: one.close_inherited())


def _gone() -> SafetyError:
    return SafetyError(
        "the guardian is gone or stands still, and the source must not heat without it",
        where="guardian",
        cure="end this program and start it again",
    )


def _piped(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None  # Popen was called with pipes
    return end
