"""Where the simulated device can be reached: here by a pseudo-terminal, in `tcpdoor.py` by a TCP port.

To the program at the other end a pseudo-terminal is a serial port like any other. A door tells the server which
descriptors to listen on; what one of them brings belongs to a talk, which takes the replies.
"""

from __future__ import annotations

import contextlib
import os
import tty
from pathlib import Path
from typing import NamedTuple, Protocol

from firmware_sim.ports import Port
from smadrive.errors import ConfigError

_CHUNK = 512


class Talk(Protocol):
    """One conversation: the port of the device that hears it, and the way back."""

    port: Port

    def send(self, reply: bytes) -> None:
        """Let `reply` go; lost when nobody takes it."""
        ...


class Heard(NamedTuple):
    """What a talk brought."""

    talk: Talk
    data: bytes


class Door(Protocol):
    """A way in. `url` is what a driver connects to."""

    url: str

    def descriptors(self) -> list[int]:
        """What to listen on."""
        ...

    def hear(self, descriptor: int) -> Heard | None:
        """Take what has arrived there; None: a client came or went."""
        ...

    def close(self) -> None:
        """Let nobody in any more."""
        ...


class Terminal:
    """A pseudo-terminal in raw mode, door and only talk. Its far end stays open here: clients may come and go."""

    def __init__(self, link: Path | None, port: Port) -> None:
        """Open it, and name it `link` too; ConfigError when that path is taken or cannot be made."""
        self.port = port
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._near, False)
        self._link = link
        path = os.ttyname(self._far)
        if link is not None:
            try:
                _make_link(link, path)
            except ConfigError:
                self._link = None
                self.close()
                raise
            path = str(link.absolute())
        self.url = f"serial://{path}"

    def descriptors(self) -> list[int]:
        """The near end."""
        return [self._near]

    def hear(self, descriptor: int) -> Heard:
        """Take what has arrived."""
        return Heard(self, os.read(descriptor, _CHUNK))

    def send(self, reply: bytes) -> None:
        """Let `reply` go; nobody reads and the line is full: a real line loses it too."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._near, reply)

    def close(self) -> None:
        """Close both ends and remove the link."""
        os.close(self._near)
        os.close(self._far)
        if self._link is not None:
            self._link.unlink(missing_ok=True)


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink() and not link.exists():
        link.unlink()  # left behind by a simulator that was killed
    try:
        link.symlink_to(target)
    except OSError as error:
        raise ConfigError(
            f"--pty {link}: cannot be made ({error.strerror}); remove it or choose another path"
        ) from None
