"""The driver's client of the guardian: it starts the guardian, sends heartbeats, and ends a take-over."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from types import TracebackType
from typing import Self
from weakref import WeakSet

from smadrive.devices.guardian.channel import Channel, Reply
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
from smadrive.devices.state.lock import NO_DESCRIPTOR, LineLock, Role
from smadrive.errors import SafetyError, TakenOverError
from smadrive.modbus.transports.connect import latency_s_of
from smadrive.posix import released_in_children

STARTS_WITHIN_S = 20.0
ENDS_WITHIN_S = 5.0
FREES_WITHIN_S = 5.0
"""The driver waits this time, and the response time of the device, for its ports. It then kills a silent guardian."""
TAKES_WITHIN_S = 1.0
PATIENCE = 2.0
"""The driver waits `PATIENCE * timeout_s` for an answer of the guardian, which takes over after `timeout_s`."""
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
        self._frees_within_s = FREES_WITHIN_S

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
        self._channel = Channel(self._process.stdin, self._process.stdout)
        _clients.add(self)
        return self

    def configure(self, identity: Identity) -> None:
        """Send the guardian its task with the identity of the device, and wait until the guardian is ready.

        The device must be confirmed off before this call, because the call ends the guardians of earlier runs that
        still wait for this device. SafetyError when the guardian does not start.
        """
        device = replace(self._task.device, identity=dict(identity))
        profile = load_profile(device.profile)
        self._frees_within_s = FREES_WITHIN_S + profile.timing.response_timeout_ms / 1e3 + latency_s_of(device.url)
        relieve(key_at(device.url, profile, device.unit_id).with_identity(profile, identity))
        shared = tuple(SharedLock(lock.line, lock.descriptor) for lock in self._locks)
        self._channel.write(replace(self._task, device=device, locks=shared).to_json())
        if self._channel.first_byte(STARTS_WITHIN_S) != READY:
            self._process.kill()
            raise SafetyError(
                "the guardian did not start, and a source without a watchdog must not heat without a guardian",
                where="guardian",
                cure="install smadrive, or set PYTHONPATH to it",
            )
        self._channel.do_not_wait()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pipes. The guardian then ends, but first switches the source off if it is not confirmed off."""
        self._channel.close()
        if self._state is not WatchState.STANDING_BY:
            return
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:  # the guardian stands still, and is not needed any more
            self._end()

    def close_inherited(self) -> None:
        """Close the pipes in a forked child: the guardian must notice the end of the driver, not of the child."""
        self._channel.close()
        self._state = WatchState.STANDING_BY

    def watch(self) -> None:
        """Tell the guardian that heating begins; SafetyError when the guardian is gone."""
        self._channel.received()  # drops the answers of the previous watch
        self._channel.answered_s = time.monotonic()
        if not self._channel.send(WATCH):
            raise _gone()
        if self._state is WatchState.STANDING_BY:  # only `take_back` ends a take-over
            self._state = WatchState.WATCHED

    def heartbeat(self) -> None:
        """Send a heartbeat if the guardian watches.

        Call this before every use of a port (see `PortAccess`). TakenOverError if the guardian uses the ports.
        """
        if self._state is WatchState.STANDING_BY:
            return
        if TAKEN in self._channel.received():
            self._state = WatchState.TAKEN_OVER
            self._give_way()
            self._channel.send(GIVES_WAY)
        if (reason := REASONS.get(self._state)) is not None:
            raise TakenOverError(f"the guardian has taken over, because {reason}")
        self._channel.send(HEARTBEAT)

    def check(self) -> None:
        """Send a heartbeat before a command; SafetyError when the guardian no longer answers."""
        self.heartbeat()
        silent_s = time.monotonic() - self._channel.answered_s
        is_silent = self._channel.has_ended or silent_s > PATIENCE * self._task.timeout_s
        if self._state is WatchState.WATCHED and is_silent:
            raise _gone()

    def hand_over(self) -> bool:
        """Close the connections and let the guardian switch off, because the driver could not.

        Return True if the guardian has taken over; then no heartbeat keeps it from the device, which it may find at
        another port. Return False if it does not watch, has ended, or does not answer within `TAKES_WITHIN_S`.
        """
        if self._state is not WatchState.WATCHED:
            return False
        self._give_way()
        if self._channel.ask(HAND_OVER, TAKEN, TAKES_WITHIN_S) is Reply.ANSWERED:
            self._state = WatchState.HANDED_OVER
        return self._state is WatchState.HANDED_OVER

    def take_back(self) -> None:
        """After a take-over or a hand-over, wait until the guardian has finished, and get the ports back.

        A guardian that gives no sign of life for `FREES_WITHIN_S` and the response time of the device is killed: the
        driver goes on alone. SafetyError when the guardian works but does not finish in this time. It then continues
        its attempts to switch off.
        """
        if self._state not in REASONS:
            return
        match self._freed():
            case Reply.WORKING:
                raise SafetyError(
                    "the guardian has taken over and could not confirm yet that the heater is off",
                    where="guardian",
                    limit=f"{self._frees_within_s:g} s",
                    cure="cut the supply of the heater",
                )
            case Reply.SILENT:
                self._end()
            case Reply.ANSWERED | Reply.ENDED:
                pass
        self._state = WatchState.STANDING_BY

    def stand_down(self) -> None:
        """End the watch after the driver has confirmed the source off.

        If the guardian is taking over at this moment, wait until it has finished; if that takes too long, kill it.
        """
        if self._state is not WatchState.STANDING_BY:
            self._state = WatchState.STANDING_BY
            if self._freed() in (Reply.WORKING, Reply.SILENT):
                self._end()  # later it could use the ports while another program uses them

    def _end(self) -> None:
        """Kill the guardian. The line then belongs to the driver alone."""
        self._process.kill()
        self._process.wait()
        for lock in self._locks:
            lock.hold_as(Role.DRIVER, os.getpid())

    def _freed(self) -> Reply:
        """Ask the guardian for the ports. They are free after ANSWERED or ENDED."""
        return self._channel.ask(STAND_DOWN, FREE, self._frees_within_s)


_clients: WeakSet[GuardianClient] = released_in_children(lambda one: one.close_inherited())


def _gone() -> SafetyError:
    return SafetyError(
        "the guardian is gone or stands still, and the source must not heat without it",
        where="guardian",
        cure="end this program and start it again",
    )
