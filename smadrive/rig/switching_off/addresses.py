"""Finds the addresses in the text of a rig file, however wrong the file is.

A driver can be asked to stop as soon as its line is known. So a mistake in a profile, in a header or in the quotes of a
value must not keep a driver running. The addresses serve only to ask drivers to stop, never to write to a device.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

from smadrive.devices.state.key import DeviceKey, unit_key
from smadrive.errors import ConfigError

_URL = re.compile(r"\b(?:serial|tcp|rtu\+tcp)://[^\s\"'#,}\]]+")
_PATH = re.compile(r"[=\s\"'](/[^\s\"'#,}\]]+)")
"""A path without a scheme, taken for a serial port. A path of another file does no harm: no driver listens there."""
_COMMENT = re.compile(r"#.*")
_UNIT_ID = re.compile(r"\bunit_id\s*=\s*(\d+)")
MOST_ADDRESSES = 64
"""Further addresses of a text are ignored. No rig file has as many."""


def keys_in(text: str) -> tuple[DeviceKey, ...]:
    """Return one key for each pair of an address and a unit id in the text.

    The unit id 1 is always used, too, because a text may have none. Comments are ignored, and so are addresses that
    name no port.
    """
    text = _COMMENT.sub("", text)
    unit_ids = {1, *map(int, _UNIT_ID.findall(text))}
    urls = list(dict.fromkeys([*_URL.findall(text), *(f"serial://{path}" for path in _PATH.findall(text))]))
    return tuple(key for url in urls[:MOST_ADDRESSES] for key in _keys_at(url, unit_ids))


def _keys_at(url: str, unit_ids: set[int]) -> Iterator[DeviceKey]:
    with suppress(ConfigError, ValueError):
        key = unit_key(url, None)
        yield from (replace(key, unit_id=unit_id) for unit_id in sorted(unit_ids))
