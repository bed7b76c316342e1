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
    """A driver that was asked to stop and has released the line. `killed` is True if it did not answer."""

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
        except TimeoutError:  # its backlog is full: it is paused or hangs, and other programs wait
            raise SafetyError(
                "its driver does not answer", where=line, cure="end that driver (kill -9), then run this again"
            ) from None
        except OSError:
            return None
        driver = peer_of(connection)
        if _is_released(connection, driver, line):
            return StoppedDriver(driver.pid, killed=False)
        _kill(driver, line)
        return StoppedDriver(driver.pid, killed=True)


def _is_released(connection: socket.socket, driver: PeerProcess, line: str) -> bool:
    """Wait for the end of the connection. Return False after a timeout. SafetyError when the driver refuses."""
    try:
        if connection.recv(len(REFUSED)) == REFUSED:
            raise SafetyError(
                f"its driver (process {driver.pid}) goes on: your user may not open this port",
                where=line,
                cure=f"run `smadrive off` as {who_may_open(line)}, or cut the heater's supply",
            )
    except TimeoutError:
        return False
    except ConnectionError:  # it was killed
        return True
    return True


def _kill(driver: PeerProcess, line: str) -> None:
    """Kill the driver, then wait until the driver and its guardians have ended.

    A process id may be reused, so every process is opened before the kill. The guardians may belong to another user,
    whose locks this process does not see.
    """
    with suppress(ProcessLookupError), ExitStack() as stack:
        process = _opened(driver.pid, stack)
        guardians = [_opened(pid, stack) for pid in _guardians_of(driver.pid)]
        try:
            signal.pidfd_send_signal(process, signal.SIGKILL)
            select.select((process,), (), (), DIES_WITHIN_S)
            for guardian in guardians:
                select.select((guardian,), (), (), GUARDIAN_WITHIN_S)
        except PermissionError:
            raise SafetyError(
                f"its driver (process {driver.pid}) does not answer, and your user may not end it",
                where=line,
                cure=f"end it as its user or as root (`sudo kill -9 {driver.pid}`), then run this again",
            ) from None


def _opened(pid: int, stack: ExitStack) -> int:
    """Return a descriptor of the process, which `stack` closes."""
    descriptor = os.pidfd_open(pid)
    stack.callback(os.close, descriptor)
    return descriptor


def _guardians_of(pid: int) -> list[int]:
    """Return the guardians that this process has started."""
    with suppress(OSError):
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [int(child) for child in children if GUARDIAN in Path(f"/proc/{child}/cmdline").read_bytes()]
    return []
