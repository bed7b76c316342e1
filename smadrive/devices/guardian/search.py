"""The search for the port of a guarded device. It tries all names of the port, but no port of another adapter.

If another device has answered several times at a port, the guardian does not use this port for a while, because another
program may use it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from smadrive.devices.state.key import port_names
from smadrive.modbus.transports.connect import port_of
from smadrive.modbus.transports.pseudo_terminal import TERMINALS, PseudoTerminal

AGREEING = 3
"""Number of wrong identities in a row that prove another device. A single wrong identity can come from a late reply."""
ASK_AGAIN_S = 10.0
"""After `AGREEING` wrong identities in a row, the port is tried again after this time in seconds."""


class PortSearch:
    """Finds the ports at which a device may be now.

    `url` is the URL of the device's port at the start of the guardian, `names` are the names of this port at that time.
    """

    def __init__(self, url: str, names: frozenset[str], now_s: Callable[[], float]) -> None:
        self._url = url
        self._names = names
        self._now_s = now_s
        self._terminals = {path: PseudoTerminal.at(path) for path in map(_path, self._candidates())}
        self._terminal = self._terminals[_path(url)]
        self._foreign: dict[str, tuple[int, float]] = {}

    def urls(self) -> list[str]:
        """Return the URLs to try now, with each port only once."""
        found: dict[str, str] = {}
        for url in self._candidates():
            if self._may_be(url):
                found.setdefault(_place(url), url)
        return [url for place, url in found.items() if not self._is_left_alone(place)]

    def note_other_device(self, url: str) -> None:
        """Note that another device answered at `url`."""
        count, _ = self._foreign.get(place := _place(url), (0, 0.0))
        self._foreign[place] = count + 1, self._now_s() + ASK_AGAIN_S

    def note_no_device(self, url: str) -> None:
        """Note that no device identified itself at `url`: the count of wrong identities begins anew."""
        self._foreign.pop(_place(url), None)

    @property
    def is_gone(self) -> bool:
        """True if the port was a pseudo-terminal that has ended and whose name cannot come back."""
        terminals = {name for name in self._names if name.startswith(TERMINALS)}
        links = self._names - terminals
        if not terminals or any(Path(link).parent.is_dir() for link in links):
            return False
        if self._terminal is not None:
            return not self._terminal.exists
        return not terminals & port_names(self._url)

    def _candidates(self) -> list[str]:
        """Return the URLs of the port at the start and of its permanent names."""
        return [self._url, *(self._at(name) for name in sorted(self._names) if name.startswith("/"))]

    def _at(self, name: str) -> str:
        """Return the URL of the serial port at path `name`, with the query of the original URL."""
        query = urlsplit(self._url).query
        return f"serial://{name}?{query}" if query else f"serial://{name}"

    def _may_be(self, url: str) -> bool:
        parts = urlsplit(url)
        if parts.scheme != "serial":
            return url == self._url
        if not Path(parts.path).exists() or self._is_left_over(parts.path):
            return False
        if self._terminal is not None and self._terminal.is_at(parts.path):
            return True
        names = port_names(url)
        return bool(names & self._names) or not (names and self._names)

    def _is_left_over(self, path: str) -> bool:
        """Return True if the pseudo-terminal at `path` has ended and the links of the path have not changed since.

        Then the path may lead to another pseudo-terminal now.
        """
        terminal = self._terminals[path]
        if terminal is not None and terminal.is_left_over:
            return True
        self._terminals[path] = PseudoTerminal.at(path)
        return False

    def _is_left_alone(self, place: str) -> bool:
        count, until_s = self._foreign.get(place, (0, 0.0))
        return count >= AGREEING and self._now_s() < until_s


def _path(url: str) -> str:
    return urlsplit(url).path


def _place(url: str) -> str:
    """Return a text that names the port of a URL. After a replug, a serial port has another text."""
    port = port_of(url)
    if port.startswith("serial:"):
        with suppress(OSError):
            return f"{port} {Path(urlsplit(port).path).stat().st_ctime_ns}"
    return port
