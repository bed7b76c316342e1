"""Finds and stops the drivers of a rig for `off`. A driver is a process that controls devices.

`off` asks the driver of a line to stop before it uses the line, because two programs on one line would take each
other's replies for their own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack

from smadrive.devices.state.key import DeviceKey
from smadrive.devices.state.lock import lines_of
from smadrive.devices.stopping.endpoint import alternative_names, names_of_line
from smadrive.devices.stopping.request import ANSWERS_WITHIN_S, StoppedDriver, ask_to_stop
from smadrive.errors import SafetyError
from smadrive.rig.switching_off.each import each

MOST_LATE = 4
"""`off` gives up after this number of rounds that stopped a driver. The user must end the program that starts them."""


def stop_drivers(keys: Iterable[DeviceKey]) -> tuple[tuple[StoppedDriver, ...], Exception | None]:
    """Stop the drivers that use the lines of the devices with these keys.

    Return the stopped drivers, and the first error or None. All drivers share one deadline, `ANSWERS_WITHIN_S` after
    the call. A driver that listens at several names is returned once.
    """
    lines = {name: line for key in keys for name, line in _names_and_lines(key)}
    deadline_s = time.monotonic() + ANSWERS_WITHIN_S
    with ExitStack() as stack:
        requests, unreachable = each(lines.items(), lambda one: ask_to_stop(one[1], one[0], deadline_s, stack))
        ended, failure = each(filter(None, requests), lambda request: request.wait(deadline_s))
    stopped: dict[int, StoppedDriver] = {}
    for driver in ended:
        stopped.setdefault(driver.pid, driver)
    return tuple(stopped.values()), unreachable or failure


def stop_late_drivers(
    keys: Sequence[DeviceKey], confirm_again: Callable[[], Exception | None]
) -> tuple[tuple[StoppedDriver, ...], Exception | None, Exception | None]:
    """Stop the drivers that started after `stop_drivers` and before `off` locked the line, until no driver is left.

    After each round that stopped a driver, `confirm_again` confirms the heat sources off, and returns its first error
    or None. A driver of another user can start at any time, because locks are per user.

    Return the stopped drivers, the first error in stopping drivers of the last round, and the last error of
    `confirm_again`, or a SafetyError if each of `MOST_LATE` rounds has stopped a driver; None without error.
    """
    stopped: tuple[StoppedDriver, ...] = ()
    unconfirmed: Exception | None = None
    for _ in range(MOST_LATE):
        late, refused = stop_drivers(keys)
        if not late:
            return stopped, refused, unconfirmed
        stopped += late
        unconfirmed = confirm_again()
    endless = SafetyError(
        "each time a driver was stopped, a new driver started",
        value=f"process {stopped[-1].pid} was the last",
        limit=MOST_LATE,
        cure="end the program that starts the drivers, or cut the heater's supply",
    )
    return stopped, refused, endless


def _names_and_lines(key: DeviceKey) -> list[tuple[str, str]]:
    """Return pairs: a name at which a driver of the device may listen, and the line that this driver uses."""
    names = ((name, line) for line in lines_of(key) for name in names_of_line(line, key))
    return [(listening, line) for name, line in names for listening in alternative_names(name)]
