"""Where the simulated device can be reached: here by a pseudo-terminal, in `tcpdoor.py` by a TCP port.

To the program at the other end a pseudo-terminal is a serial port like any other. A door tells the server which
descriptors to listen on; what one of them brings belongs to a talk, which takes the replies. A door can be closed and
opened again, as an adapter can be pulled out and put back.
"""

from __future__ import annotations

import contextlib
import os
import tty
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from firmware_sim.bus.ports import Port
from smadrive.errors import ConfigError

_CHUNK = 512


class EndpointConnection(Protocol):
    """One conversation: the port of the device that hears it, and the way back."""

    port: Port

    def send(self, reply: bytes) -> None:
        """Let `reply` go; lost when nobody takes it."""
        ...


class Heard(NamedTuple):
    """What a talk brought."""

    talk: EndpointConnection
    data: bytes


class Endpoint(Protocol):
    """A way in. `url` is what a driver connects to."""

    url: str

    def open(self) -> None:
        """Let clients in again."""
        ...

    def descriptors(self) -> list[int]:
        """What to listen on."""
        ...

    def talks(self) -> Sequence[EndpointConnection]:
        """Those that are going on."""
        ...

    def hear(self, descriptor: int) -> Heard | None:
        """Take what has arrived there; None: nothing, a client came or went."""
        ...

    def close(self) -> None:
        """End every talk and let nobody in any more."""
        ...


class Terminal:
    """A pseudo-terminal in raw mode, door and only talk. Its far end stays open here: clients may come and go.

    With a link it has a name that lasts: without one it may get another when it is opened again.
    """

    def __init__(self, link: Path | None, port: Port) -> None:
        """Open it, and name it `link` too; ConfigError when that path is taken or cannot be made."""
        self.port = port
        self._link = link
        self._ends: tuple[int, ...] = ()
        self.open()

    def open(self) -> None:
        """Open both ends."""
        near, far = os.openpty()
        tty.setraw(far)
        os.set_blocking(near, False)
        path = os.ttyname(far)
        if self._link is not None:
            try:
                _make_link(self._link, path)
            except ConfigError:
                os.close(near)
                os.close(far)
                raise
            path = str(self._link.absolute())
        self._ends = near, far
        self.url = f"serial://{path}"

    def descriptors(self) -> list[int]:
        """The near end."""
        return list(self._ends[:1])

    def talks(self) -> Sequence[EndpointConnection]:
        """Itself."""
        return (self,)

    def hear(self, descriptor: int) -> Heard | None:
        """Take what has arrived."""
        try:
            return Heard(self, os.read(descriptor, _CHUNK)) if descriptor in self._ends else None
        except BlockingIOError:
            return None

    def send(self, reply: bytes) -> None:
        """Let `reply` go; the line is closed, or full and nobody reads: a real line loses it too."""
        if self._ends:
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], reply)

    def close(self) -> None:
        """Close both ends and remove the link."""
        for end in self._ends:
            os.close(end)
        if self._ends and self._link is not None:
            self._link.unlink(missing_ok=True)
        self._ends = ()


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink() and (not link.exists() or link.readlink() == Path(target)):
        link.unlink()  # left behind by a simulator that was killed, whose terminal's number may be this one's now
    try:
        link.symlink_to(target)
    except OSError as error:
        raise ConfigError(
            f"--pty {link}: cannot be made ({error.strerror}); remove it or choose another path"
        ) from None
