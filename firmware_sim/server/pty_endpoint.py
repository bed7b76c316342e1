"""A simulated device on a pseudo-terminal. To the program at the other end it is a serial port like any other."""

from __future__ import annotations

import contextlib
import os
import tty
from collections.abc import Sequence
from pathlib import Path

from firmware_sim.bus.ports import Port
from firmware_sim.server.endpoint import EndpointConnection, Received
from smadrive.errors import ConfigError

_CHUNK = 512


class PtyEndpoint:
    """A pseudo-terminal in raw mode: an endpoint, and its only connection.

    Its far end stays open here, so clients may come and go. With a link it has a lasting name; without one its name may
    differ after it was opened again.
    """

    def __init__(self, link: Path | None, port: Port) -> None:
        """Open it, and make the symbolic link; ConfigError when that path is taken or cannot be made."""
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

    def connections(self) -> Sequence[EndpointConnection]:
        """The endpoint itself."""
        return (self,)

    def receive(self, descriptor: int) -> Received | None:
        """Take the bytes that have arrived."""
        try:
            return Received(self, os.read(descriptor, _CHUNK)) if descriptor in self._ends else None
        except BlockingIOError:
            return None

    def send(self, reply: bytes) -> None:
        """Send `reply`; like on a real line it is lost when the port is closed, or full and not read."""
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
        link.unlink()  # left behind by a killed simulator, whose pseudo-terminal's number may be this one's now
    try:
        link.symlink_to(target)
    except OSError as error:
        raise ConfigError(
            f"cannot be made ({error.strerror})", where=f"--pty {link}", cure="remove it, or choose another path"
        ) from None
