"""Finds the addresses in the text of a rig file, however wrong the file is.

A driver can be asked to stop as soon as its line is known. So a mistake in a profile, in a header or in the quotes of a
value must not keep a driver running. An address that is found here is never used to write to a device: only the drivers
of its line are asked to stop.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from smadrive.devices.state.key import DeviceKey, port_names
from smadrive.errors import ConfigError
from smadrive.modbus.transports.connect import port_of

_URL = re.compile(r"\b(?:serial|tcp|rtu\+tcp)://[^\s\"'#,}\]]+")
_PATH = re.compile(r"[=\s\"'](/[^\s\"'#,}\]]+)")
"""A path without its scheme. It is taken for a serial port: nothing listens at the name of any other path."""
_COMMENT = re.compile(r"#.*")
_UNIT_ID = re.compile(r"\bunit_id\s*=\s*(\d+)")
MOST_ADDRESSES = 64
"""A text with more addresses is no rig file."""


def keys_in(text: str) -> tuple[DeviceKey, ...]:
    """Return a key for each address in the text and each unit id that a device there may have.

    These are all unit ids in the text, and 1. Comments, and addresses that name no port, are left out.
    """
    text = _COMMENT.sub("", text)
    unit_ids = {1, *map(int, _UNIT_ID.findall(text))}
    urls = list(dict.fromkeys([*_URL.findall(text), *(f"serial://{path}" for path in _PATH.findall(text))]))
    return tuple(key for url in urls[:MOST_ADDRESSES] for key in _keys_at(url, unit_ids))


def _keys_at(url: str, unit_ids: set[int]) -> Iterator[DeviceKey]:
    try:
        names, port = port_names(url), port_of(url)
    except (ConfigError, ValueError):
        return
    yield from (DeviceKey(names, unit_id, port=port) for unit_id in sorted(unit_ids))
