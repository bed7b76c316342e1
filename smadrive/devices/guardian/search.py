"""The ports at which a guardian looks for its device: each permanent name of its port, never another adapter's port.

A port at which another device has answered several times is left alone for a while: another program may use it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from smadrive.devices.state.key import TERMINALS, port_names
from smadrive.modbus.transports.connect import port_of

AGREEING = 3
"""Identities in a row that prove another device: a single one can be a late reply of the line."""
ASK_AGAIN_S = 10.0
"""A port with another device is tried again after this time."""


class PortSearch:
    """The ports at which a device may be now that was found at the port of `url`, with these names."""

    def __init__(self, url: str, names: frozenset[str], now_s: Callable[[], float]) -> None:
        self._url = url
        self._names = names
        self._now_s = now_s
        self._foreign: dict[str, tuple[int, float]] = {}

    def urls(self) -> list[str]:
        """The URLs to try now, each port once."""
        found: dict[str, str] = {}
        links = (name for name in sorted(self._names) if name.startswith("/"))
        for url in (self._url, *map(self._at, links)):
            if self._may_be(url):
                found.setdefault(_place(url), url)
        return [url for place, url in found.items() if not self._is_left_alone(place)]

    def note_other_device(self, url: str) -> None:
        """Note that another device answered there."""
        count, _ = self._foreign.get(place := _place(url), (0, 0.0))
        self._foreign[place] = count + 1, self._now_s() + ASK_AGAIN_S

    def note_no_device(self, url: str) -> None:
        """Note that no device proved its identity there."""
        self._foreign.pop(_place(url), None)

    @property
    def is_gone(self) -> bool:
        """Whether the port was a pseudo-terminal that has ended and cannot come back under its name."""
        terminals = {name for name in self._names if name.startswith(TERMINALS)}
        links = self._names - terminals
        if not terminals or any(Path(link).parent.is_dir() for link in links):
            return False
        return not terminals & port_names(self._url)

    def _at(self, name: str) -> str:
        """The URL with the same settings at a path among the names."""
        query = urlsplit(self._url).query
        return f"serial://{name}?{query}" if query else f"serial://{name}"

    def _may_be(self, url: str) -> bool:
        parts = urlsplit(url)
        if parts.scheme != "serial":
            return url == self._url
        if not Path(parts.path).exists():
            return False
        names = port_names(url)
        return bool(names & self._names) or not (names and self._names)

    def _is_left_alone(self, place: str) -> bool:
        count, until_s = self._foreign.get(place, (0, 0.0))
        return count >= AGREEING and self._now_s() < until_s


def _place(url: str) -> str:
    """The port that a URL leads to now, with the time of its creation: a port that was plugged in anew differs."""
    port = port_of(url)
    if port.startswith("serial:"):
        with suppress(OSError):
            return f"{port} {Path(urlsplit(port).path).stat().st_ctime_ns}"
    return port
