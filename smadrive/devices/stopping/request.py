"""The request with which `smadrive off` stops a driver: afterwards the line is free, or an error gives the reason.

A driver that is paused (SIGSTOP) or hangs cannot release its line, so it is killed. Its guardian, or the watchdog of
its device, then switches the heater off, and no other program uses the line.
"""

from __future__ import annotations

import os
import select
import signal
import socket
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

from smadrive.devices.state.lock import GUARDIAN_WITHIN_S
from smadrive.devices.stopping.endpoint import IS_POSSIBLE, REFUSED, PeerProcess, address_of, peer_of, who_may_open
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


def stop_driver(line: str, name: str, within_s: float = ANSWERS_WITHIN_S) -> StoppedDriver | None:
    """Ask the driver of `line` to stop, and wait until it has released the line; return None if there is no driver.

    `name` is the name of the line under which the driver listens. A driver that has not released the line after
    `within_s` is killed; then this function waits for its guardian. SafetyError when this user may not stop the driver.
    """
    if not IS_POSSIBLE:
        return None
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(within_s)
        try:
            connection.connect(address_of(name))
        except TimeoutError:  # the backlog is full: the driver is paused or hangs, and other programs wait
            raise SafetyError(
                "its driver does not answer", where=line, cure="end that driver (kill -9), then repeat `smadrive off`"
            ) from None
        except OSError:
            return None
        driver = peer_of(connection)
        with ExitStack() as stack:
            process = _descriptor(driver.pid, stack)
            if _is_released(connection, driver, line):
                return StoppedDriver(driver.pid, killed=False)
            if process is None:
                raise SafetyError(
                    "its driver does not answer, and this process cannot end it",
                    where=line,
                    cure="end the driver where it runs, such as in its container, or cut the heater's supply",
                )
            _kill(process, driver, line)
            return StoppedDriver(driver.pid, killed=True)


def _is_released(connection: socket.socket, driver: PeerProcess, line: str) -> bool:
    """Return True when the driver ends the connection, False after a timeout. SafetyError when the driver refuses."""
    try:
        if connection.recv(len(REFUSED)) == REFUSED:
            raise SafetyError(
                f"its driver (process {driver.pid}) refuses to stop, because your user may not open this port",
                where=line,
                cure=f"run `smadrive off` as {who_may_open(line)}, or cut the heater's supply",
            )
    except TimeoutError:
        return False
    except ConnectionError:  # the driver was killed
        return True
    return True


def _kill(process: int, driver: PeerProcess, line: str) -> None:
    """Kill the driver, whose descriptor is `process`, then wait until the driver and its guardians have ended.

    Wait for the guardian processes, not for their locks, because another user's locks are in another folder.
    """
    with ExitStack() as stack:
        guardians = [_descriptor(pid, stack) for pid in _guardians_of(driver.pid)]
        try:
            signal.pidfd_send_signal(process, signal.SIGKILL)
        except ProcessLookupError:  # it has just ended
            pass
        except PermissionError:
            raise SafetyError(
                f"its driver (process {driver.pid}) does not answer, and your user may not end it",
                where=line,
                cure=f"end the driver as its user or as root (`sudo kill -9 {driver.pid}`), then repeat `smadrive off`",
            ) from None
        select.select((process,), (), (), DIES_WITHIN_S)
        for guardian in guardians:
            if guardian is not None:
                select.select((guardian,), (), (), GUARDIAN_WITHIN_S)


def _descriptor(pid: int, stack: ExitStack) -> int | None:
    """Return a descriptor of the process, which `stack` closes; None if the process has ended or is not visible.

    A process id may soon name another process, but a descriptor always means the same one.
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
