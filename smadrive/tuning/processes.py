"""Starts and ends the front process, the page process and the model builder process: child processes of the driver."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import TYPE_CHECKING, Self

from smadrive.errors import ConfigError
from smadrive.files.extras import check_extra
from smadrive.stream.supervised_process import SupervisedProcess
from smadrive.tuning.builder.build import BuildFailure, BuildRequest, BuildResult
from smadrive.tuning.builder.packing import pack_request, unpack_result
from smadrive.tuning.link.address import ADDRESS
from smadrive.tuning.link.channel import DriverEnd

if TYPE_CHECKING:
    from smadrive.tuning.link.message_socket import MessageSocket

BACKLOG = 512
"""Largest number of connections that wait while the front process is restarted."""

NICENESS = 5
"""Niceness of the page process. The model builder has niceness 0, because the user waits for its result."""

FRONT_NICENESS = -10
"""Niceness of the front process: if the system permits, OFF is answered before other work."""

EXTRA = "tune"
"""These processes need the optional dependencies `smadrive[tune]`."""

FROZEN_LOOKS = 10
"""The front process is killed after this number of checks without a heartbeat, which is after 1 s.

Checks are counted, not seconds, because the driver itself may be paused. During a pause no check is made, so a pause
does not kill the front process.
"""


FROZEN_BUILD_LOOKS = 300
"""The model builder is killed after this number of checks without a result, which is after 30 s. A build takes 1 s."""


class PageProcess(SupervisedProcess):
    """Builds the pages. It listens for the front process on the Unix socket at `path`.

    `document` has the parameters of the pages. With the key `token` they are tuning pages, one of which can control the
    session; without it they are pages of `smadrive watch`.
    """

    def __init__(self, channel: DriverEnd, *, port: int, path: str, document: Mapping[str, str]) -> None:
        parameters = {**_ends(channel), "port": port, "path": path, **document}
        super().__init__(
            "smadrive.tuning.page.process", parameters, tuple(_ends(channel).values()), extra=EXTRA, niceness=NICENESS
        )


class FrontProcess(SupervisedProcess):
    """Answers OFF on the page's port, and passes page loads on to the socket at `path`."""

    def __init__(self, channel: DriverEnd, listener: socket.socket, path: str) -> None:
        fds = {**_ends(channel), "listener_fd": listener.fileno()}
        parameters = {**fds, "port": listener.getsockname()[1], "path": path}
        super().__init__(
            "smadrive.tuning.front.process", parameters, tuple(fds.values()), extra=EXTRA, niceness=FRONT_NICENESS
        )
        self._channel = channel
        self._beats = self._looks = 0

    def _is_frozen(self) -> bool:
        """Return True if no heartbeat came during `FROZEN_LOOKS` checks."""
        beats = self._channel.front_beats
        self._looks = self._looks + 1 if beats == self._beats else 0
        self._beats = beats
        return self._looks >= FROZEN_LOOKS


class LivePage:
    """A page in the browser: its port, its front process and its page process. A context manager.

    `document` is that of PageProcess. `url`, the address of the page, is valid inside the context. ConfigError when a
    process does not start, or when the port cannot be opened, for example because another program uses it.
    """

    server: PageProcess
    front: FrontProcess

    def __init__(self, channel: DriverEnd, *, port: int, document: Mapping[str, str]) -> None:
        self._channel = channel
        self._port = port
        self._document = document

    @property
    def troubles(self) -> list[str]:
        """The reasons why the front process or the page process could not be restarted."""
        processes: list[SupervisedProcess] = [self.front, self.server] if hasattr(self, "_on_exit") else []
        return [process.trouble for process in processes if process.trouble]

    @property
    def url(self) -> str:
        """The address of the page."""
        return f"http://{ADDRESS}:{self._port}/"

    def __enter__(self) -> Self:
        """Open the port and start both processes. On exit, the front process ends first and informs the pages."""
        with ExitStack() as stack:
            listener = stack.enter_context(_listen(self._port))
            self._port = listener.getsockname()[1]
            path = str(Path(stack.enter_context(TemporaryDirectory(prefix="smadrive-"))) / "page")
            self.server = PageProcess(self._channel, port=self._port, path=path, document=self._document)
            stack.enter_context(self.server)
            self.front = stack.enter_context(FrontProcess(self._channel, listener, path))
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End both processes."""
        self._on_exit.__exit__(kind, error, trace)


class TuningPage(LivePage):
    """The tuning page. It saves new model files and rig files in `folder`. Its address contains `token`."""

    def __init__(self, channel: DriverEnd, *, port: int, token: str, rig_file: Path, folder: Path) -> None:
        document = {"token": token, "rig_file": str(rig_file), "folder": str(folder)}
        super().__init__(channel, port=port, document=document)
        self._token = token

    @property
    def url(self) -> str:
        """The address of the page, with the token that permits control."""
        return f"{super().url}?token={self._token}"


def _ends(channel: DriverEnd) -> dict[str, int]:
    """Return the file descriptors with which a child opens its `PageEnd` of the channel."""
    return {"memory_fd": channel.memory_fd, "socket_fd": channel.page_socket.fileno()}


def _listen(port: int) -> socket.socket:
    try:
        return socket.create_server((ADDRESS, port), backlog=BACKLOG)
    except OSError as error:
        raise ConfigError(
            "the port of the page cannot be opened",
            where=f"{ADDRESS}:{port}",
            value=error.strerror,
            cure="choose another --port",
        ) from None


class BuilderProcess(SupervisedProcess):
    """A ModelBuilder in a child process. ZeroMQ carries requests and results, so the loop never waits for the child."""

    def __init__(self) -> None:
        super().__init__("smadrive.tuning.builder.process", {}, (), extra=EXTRA)
        self._request: BuildRequest | None = None
        self._number = 0
        self._deaths_before = 0
        self._looked_number = self._looks = 0

    def __enter__(self) -> Self:
        """Start the process. It listens in a private folder of the user, because its messages are unpickled."""
        with ExitStack() as stack:
            folder = stack.enter_context(TemporaryDirectory(prefix="smadrive-"))
            self._parameters["address"] = f"ipc://{folder}/builder"
            self._link = stack.enter_context(_connected(self._parameters["address"]))
            super().__enter__()
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process and close the connection."""
        with self._on_exit:
            super().__exit__(kind, error, trace)

    def begin(self, request: BuildRequest) -> None:
        """Send a request to the child (see ModelBuilder). During a restart, the request waits for the new process."""
        self._number += 1
        self._request, self._deaths_before = request, self.deaths
        self._link.send(b"%d" % self._number, pack_request(request))

    def result(self) -> BuildResult | None:
        """Return the result of the request, or None until it arrives; see ModelBuilder.

        The result is a BuildFailure if the child has died since `begin`.
        """
        if self._request is None:
            return None
        result = self._received(self._request)
        if result is None and self.deaths != self._deaths_before:
            result = BuildFailure(
                "the model builder process died during this change, and is being restarted: try the change again"
            )
        if result is not None:
            self._request = None
        return result

    def _is_frozen(self) -> bool:
        """Return True if a request has had no result during `FROZEN_BUILD_LOOKS` checks."""
        is_same = self._request is not None and self._number == self._looked_number
        self._looks = self._looks + 1 if is_same else 0
        self._looked_number = self._number
        if self._looks < FROZEN_BUILD_LOOKS:
            return False
        self._looks = 0
        return True

    def _received(self, request: BuildRequest) -> BuildResult | None:
        """Return the result of `request` if it has arrived, else None. Drop the result of an earlier request."""
        message = self._link.received()
        if message is None or int(message[0]) != self._number:
            return None
        return unpack_result(message[1], request)


def _connected(address: str) -> MessageSocket:
    check_extra(EXTRA, "the model builder process")
    from smadrive.tuning.link.message_socket import MessageSocket  # noqa: PLC0415 (of the extra)

    return MessageSocket(address, listens=False)
