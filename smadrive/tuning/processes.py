"""The processes beside the loop, as the control process sees them: front, page and workshop."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

from smadrive.errors import ConfigError
from smadrive.tuning.builder.builder import Order, Outcome, Refused, packed_order, unpacked_outcome
from smadrive.tuning.link.address import ADDRESS
from smadrive.tuning.link.channel import ControlEnd
from smadrive.tuning.link.mailbox import ParcelPair
from smadrive.tuning.link.supervised_process import SupervisedProcess

BACKLOG = 512
"""Connections that wait while the front process is started anew."""

NICENESS = 5
"""The page process stands back; not the workshop, for which somebody waits."""

FRONT_NICENESS = -10
"""OFF goes first, where the system grants that."""

FROZEN_LOOKS = 10
"""The front process is killed after so many looks without a beat, 1 s. Looks, since the control process may pause."""

COMPLETE = "is the installation complete?"


class PageProcess(SupervisedProcess):
    """Builds the pages, for the front process alone, on the Unix socket at `path`."""

    def __init__(self, channel: ControlEnd, *, port: int, path: str, token: str, rig_file: Path, folder: Path) -> None:
        parameters = {
            **_ends(channel),
            "port": port,
            "path": path,
            "token": token,
            "rig_file": str(rig_file),
            "folder": str(folder),
        }
        super().__init__(
            "smadrive.tuning.page.process", parameters, tuple(_ends(channel).values()), COMPLETE, niceness=NICENESS
        )


class FrontProcess(SupervisedProcess):
    """Answers OFF on the page's port, and passes page loads on to the socket at `path`."""

    def __init__(self, channel: ControlEnd, listener: socket.socket, path: str) -> None:
        fds = {**_ends(channel), "listener_fd": listener.fileno()}
        parameters = {**fds, "port": listener.getsockname()[1], "path": path}
        super().__init__(
            "smadrive.tuning.front.process", parameters, tuple(fds.values()), COMPLETE, niceness=FRONT_NICENESS
        )
        self._channel = channel
        self._beats = self._looks = 0

    def _is_frozen(self) -> bool:
        """Whether it has not beaten for so many looks."""
        beats = self._channel.front_beats
        self._looks = self._looks + 1 if beats == self._beats else 0
        self._beats = beats
        return self._looks >= FROZEN_LOOKS


class TuningPage:
    """The tuning page: its port, its front process and its page process. A context manager.

    `url` is where the page is while it lasts. ConfigError when the port is taken.
    """

    server: PageProcess
    front: FrontProcess

    def __init__(self, channel: ControlEnd, *, port: int, token: str, rig_file: Path, folder: Path) -> None:
        self._channel = channel
        self._port = port
        self._token = token
        self._rig_file, self._folder = rig_file, folder

    @property
    def troubles(self) -> list[str]:
        """What keeps the front process or the page process from being started anew."""
        processes: list[SupervisedProcess] = [self.front, self.server] if hasattr(self, "_on_exit") else []
        return [process.trouble for process in processes if process.trouble]

    @property
    def url(self) -> str:
        """The address of the page, with the token that allows to control."""
        return f"http://{ADDRESS}:{self._port}/?token={self._token}"

    def __enter__(self) -> Self:
        """Listen, and start both processes. The front process ends first, since it tells the pages of the end."""
        with ExitStack() as stack:
            listener = stack.enter_context(_listen(self._port))
            self._port = listener.getsockname()[1]
            path = str(Path(stack.enter_context(TemporaryDirectory(prefix="smadrive-"))) / "page")
            self.server = PageProcess(
                self._channel,
                port=self._port,
                path=path,
                token=self._token,
                rig_file=self._rig_file,
                folder=self._folder,
            )
            stack.enter_context(self.server)
            self.front = stack.enter_context(FrontProcess(self._channel, listener, path))
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End both processes."""
        self._on_exit.__exit__(kind, error, trace)


def _ends(channel: ControlEnd) -> dict[str, int]:
    """The descriptors of the page's end of the channel."""
    return {"memory_fd": channel.memory_fd, "socket_fd": channel.page_socket.fileno()}


def _listen(port: int) -> socket.socket:
    try:
        return socket.create_server((ADDRESS, port), backlog=BACKLOG)
    except OSError as error:
        raise ConfigError(f"port {port} of {ADDRESS}: {error.strerror}: choose another --port") from None


class BuilderProcess(SupervisedProcess):
    """A ModelBuilder in a process of its own, at the other end of `parcels`."""

    def __init__(self, parcels: ParcelPair) -> None:
        super().__init__("smadrive.tuning.builder.process", {"fds": parcels.fds}, parcels.fds, COMPLETE)
        self._parcels = parcels
        self._order: Order | None = None
        self._number = 0
        self._deaths_before = 0

    def begin(self, order: Order) -> None:
        """See ModelBuilder."""
        self._number += 1
        self._order, self._deaths_before = order, self.deaths
        self._parcels.send(self._number, packed_order(order))

    def outcome(self) -> Outcome | None:
        """See ModelBuilder; an order that died with its process is refused."""
        if self._order is None:
            return None
        outcome: Outcome | None = None
        parcel = self._parcels.received()
        if parcel is not None and parcel.number == self._number:
            outcome = unpacked_outcome(parcel.content, self._order)
        elif self.deaths != self._deaths_before:
            outcome = Refused("the workshop process ended over it, and is started anew: try again")
        if outcome is not None:
            self._order = None
        return outcome
