"""The request with which `smadrive off` stops a driver: afterwards the line is free, or an error gives the reason.

A driver that is paused (SIGSTOP) or hangs cannot release its line, so it is killed. Then its guardian, or the watchdog
of its device, switches the heater off. Afterwards no program uses the line.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import struct
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

from smadrive.devices.state.lock import GUARDIAN_WITHIN_S
from smadrive.devices.stopping.endpoint import (
    IS_POSSIBLE,
    REFUSED,
    PeerProcess,
    address_of,
    listens,
    peer_of,
    who_may_open,
)
from smadrive.errors import SafetyError

ANSWERS_WITHIN_S = 5.0
"""Longest time in s until a driver releases its line if its first try to switch off succeeds."""

DIES_WITHIN_S = 5.0
"""Longest wait in s for the end of a killed process."""

GUARDIAN = b"smadrive.devices.guardian.process"


@dataclass(frozen=True)
class StoppedDriver:
    """A driver that has released the line after a request to stop. `killed` is True if the driver had to be killed."""

    pid: int
    killed: bool

    def __str__(self) -> str:
        return f"{'killed the hung driver' if self.killed else 'stopped the driver'} (process {self.pid})"


@dataclass(frozen=True)
class StopRequest:
    """A request to the driver of `line`, which listens at `address`.

    connection    the connection to the driver, which is the request
    driver        the process that listens, as the kernel reports it
    process       a descriptor of the driver's process; None if it has ended, or if this process cannot see it
    """

    line: str
    address: str
    connection: socket.socket
    driver: PeerProcess
    process: int | None

    def wait(self, deadline_s: float) -> StoppedDriver:
        """Wait until the driver has released the line. At `deadline_s`, kill a driver that has not released it.

        After a kill, also wait for the end of the driver's guardian, which switches the heater off. SafetyError when
        the driver refuses, or when this process cannot kill it.
        """
        if self._is_released(deadline_s):
            return StoppedDriver(self.driver.pid, killed=False)
        if self.process is None or not listens(self.driver.pid, self.address):
            raise SafetyError(
                "its driver does not answer, and this process cannot end it",
                where=self.line,
                cure="end the driver where it runs, such as in its container, or cut the heater's supply",
            )
        self._kill(self.process)
        return StoppedDriver(self.driver.pid, killed=True)

    def _is_released(self, deadline_s: float) -> bool:
        """Return True when the driver ends the connection, False at the deadline. SafetyError if the driver refuses."""
        if not select.select((self.connection,), (), (), max(deadline_s - time.monotonic(), 0.0))[0]:
            return False
        with suppress(ConnectionError):  # the driver was killed
            if self.connection.recv(len(REFUSED)) == REFUSED:
                raise SafetyError(
                    f"its driver (process {self.driver.pid}) refuses to stop, because your user may not open this port",
                    where=self.line,
                    cure=f"run `smadrive off` as {who_may_open(self.line)}, or cut the heater's supply",
                )
        return True

    def _kill(self, process: int) -> None:
        """Kill the driver, whose descriptor is `process`, then wait until the driver and its guardians have ended.

        SafetyError if this user may not kill the driver. The locks of the guardians do not show their end, because
        another user's locks are in another folder. So wait for the guardian processes.
        """
        with ExitStack() as stack:
            guardians = [_descriptor(pid, stack) for pid in _guardians_of(self.driver.pid)]
            try:
                signal.pidfd_send_signal(process, signal.SIGKILL)
            except ProcessLookupError:  # it has just ended
                pass
            except PermissionError:
                raise SafetyError(
                    f"its driver (process {self.driver.pid}) does not answer, and your user may not end it",
                    where=self.line,
                    cure=f"end the driver as its user or as root (`sudo kill -9 {self.driver.pid}`), "
                    "then repeat `smadrive off`",
                ) from None
            select.select((process,), (), (), DIES_WITHIN_S)
            for guardian in guardians:
                if guardian is not None:
                    select.select((guardian,), (), (), GUARDIAN_WITHIN_S)


def ask_to_stop(line: str, name: str, deadline_s: float, stack: ExitStack) -> StopRequest | None:
    """Ask the driver of `line` to stop, and return the request, which `stack` closes; None if there is no driver.

    `name` is the name of the line under which the driver listens. `deadline_s` is a time of the monotonic clock.
    SafetyError if the driver has not accepted the connection by then.
    """
    if not IS_POSSIBLE:
        return None
    connection = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
    within_s = max(deadline_s - time.monotonic(), 0.001)
    timeout = struct.pack("ll", int(within_s), int(within_s % 1.0 * 1e6))
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeout)  # settimeout() does not wait for the backlog
    try:
        connection.connect(address_of(name))
    except BlockingIOError:  # the backlog is full: the driver is paused or hangs, and other programs wait
        raise SafetyError(
            "its driver does not answer", where=line, cure="end that driver (kill -9), then repeat `smadrive off`"
        ) from None
    except OSError:
        return None
    driver = peer_of(connection)
    return StopRequest(line, address_of(name), connection, driver, _descriptor(driver.pid, stack))


def _descriptor(pid: int, stack: ExitStack) -> int | None:
    """Return a descriptor of the process, which `stack` closes; None if the process has ended or is not visible.

    A process id may soon belong to another process, but a descriptor always means the same process.
    """
    try:
        descriptor = os.pidfd_open(pid)
    except OSError:
        return None
    stack.callback(os.close, descriptor)
    return descriptor


def _guardians_of(pid: int) -> list[int]:
    """Return the ids of the guardians that the process `pid` has started in any of its threads."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            found += [int(child) for child in task.read_text().split() if _is_guardian(child)]
    return found


def _is_guardian(pid: str) -> bool:
    with suppress(OSError):
        return GUARDIAN in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False
