"""The lock of a port for a program that uses no rig file, such as `scan` and `board check`."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace

from smadrive.devices.state.key import DeviceKey, port_names
from smadrive.devices.state.lock import Role, check_free, lines_of, lock_line
from smadrive.modbus.transports.connect import is_one_line, port_of

UNIT_IDS = range(256)


def lock_port(url: str, unit_ids: Iterable[int]) -> ExitStack:
    """Lock the lines of these units at the port, and return a stack that unlocks them.

    BusyError if another process has locked the line of any unit at this port: a frame on an RTU line reaches every
    unit, and many gateways accept only one client. ConfigError when the URL names no port.
    """
    key = DeviceKey(port_names(url), None, port=port_of(url), is_one_line=is_one_line(url))
    lines = {unit_id: lines_of(replace(key, unit_id=unit_id)) for unit_id in (None, *UNIT_IDS)}
    with ExitStack() as stack:
        own = dict.fromkeys(line for unit_id in unit_ids for line in lines[unit_id])
        for line in own:
            stack.enter_context(lock_line(line, Role.DRIVER))
        for line in {line for others in lines.values() for line in others}.difference(own):
            check_free(line)
        return stack.pop_all()
