"""A simulated device on a pseudo-terminal. To the program at the other end it is a serial port like any other."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

from firmware_sim.bus.ports import Port
from firmware_sim.server.endpoint import EndpointConnection, Received
from smadrive.errors import ConfigError
from smadrive.modbus.transports.pseudo_terminal import TERMINALS
from smadrive.posix import tty

_CHUNK = 512


class PtyEndpoint:
    """A pseudo-terminal in raw mode. The object is the endpoint and also its only connection.

    This process keeps the client's end open too, so clients may come and go. A symbolic link gives the terminal a
    permanent name. Without a link, the name may change when the terminal is opened again.
    """

    def __init__(self, link: Path | None, port: Port) -> None:
        """Open the terminal, and make the symbolic link. ConfigError when the link cannot be made."""
        self.port = port
        self._link = link
        self._ends: tuple[int, ...] = ()
        self.open()

    def open(self) -> None:
        """Open both ends, and make the link."""
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
        """Return the descriptor of the end that this process reads. The list is empty while the endpoint is closed."""
        return list(self._ends[:1])

    def connections(self) -> Sequence[EndpointConnection]:
        """Return the endpoint itself, which is its only connection."""
        return (self,)

    def receive(self, descriptor: int) -> Received | None:
        """Return the bytes that have arrived, or None if no byte has arrived."""
        try:
            return Received(self, os.read(descriptor, _CHUNK)) if descriptor in self._ends else None
        except BlockingIOError:
            return None

    def send(self, reply: bytes) -> None:
        """Send `reply`. As on a real line, the reply is lost if the port is closed, or if the client does not read."""
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
        link.unlink()  # a killed simulator left this link; the new terminal may have the same number
    try:
        link.symlink_to(target)
    except FileExistsError:
        what, cure = "another file has this path", "choose a path that does not exist"
        if link.is_symlink() and str(link.readlink()).startswith(TERMINALS):
            what, cure = "another program serves this path", "end it (another firmware-sim?), or choose another path"
        raise ConfigError(what, where=f"--pty {link}", cure=cure) from None
    except OSError as error:
        what, cure = f"the link cannot be made ({error.strerror})", "choose a path in a folder that you may write to"
        raise ConfigError(what, where=f"--pty {link}", cure=cure) from None
