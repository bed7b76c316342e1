"""The lock of a port for a program that uses no rig file, such as `scan` and `board check`."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace

from smadrive.devices.state.key import DeviceKey, unit_key
from smadrive.devices.state.lock import Role, check_free, lines_of, lock_line

UNIT_IDS = range(256)


def lock_port(url: str, unit_ids: Iterable[int]) -> ExitStack:
    """Lock the lines of these units at the port, and return a stack that unlocks them.

    BusyError if another process has locked the line of any unit at this port: a frame on an RTU line reaches every
    unit, and many gateways accept only one client. ConfigError when the URL names no port.
    """
    key = unit_key(url, None)
    with ExitStack() as stack:
        own = dict.fromkeys(line for unit_id in unit_ids for line in lines_of(replace(key, unit_id=unit_id)))
        for line in own:
            stack.enter_context(lock_line(line, Role.DRIVER))
        for line in _all_lines(key).difference(own):
            check_free(line)
        return stack.pop_all()


def _all_lines(key: DeviceKey) -> set[str]:
    """Return the lines of every unit at the port, also those of a driver that takes it for a gateway or for a line."""
    return {
        line
        for unit_id in (None, *UNIT_IDS)
        for one in (False, True)
        for line in lines_of(replace(key, unit_id=unit_id, is_one_line=one))
    }
