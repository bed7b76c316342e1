"""The channel: it connects the driver, the page process and the front process.

No process waits for another process. The data of the channel, with writer → reader:

    driver → page          rows       a ring in shared memory: new rows overwrite the oldest
    driver → page, front   status     one JSON document in shared memory, which is replaced as a whole
    front → driver, page   OFF        a counter in shared memory, which needs no queue and no answer. A counted OFF is
                                      not lost when the front process dies. Only the front process counts, because two
                                      writers could lose a count. A request that drives the wire carries the OFF count
                                      that the page had received when the user clicked (see button_events.py)
    page → driver, front   pages      the number of open pages, and whether one of them may change the session (the
                                      others only watch)
    page → front           heartbeat  the id of the page process, and the time at which it last read the channel
    front → driver         heartbeat  a counter that increases while the front process answers
    driver ↔ page          messages   JSON datagrams on a socket pair: each arrives whole or not at all; `send` returns
                                      False if the queue is full

Rows and status have the layout of stream/shared_memory.py.
See docs/decisions/0001-processes-of-the-tuning-page.md.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any

import numpy as np

from smadrive.errors import ConfigError
from smadrive.stream.shared_memory import STREAM, SharedReader, SharedWriter

MESSAGE_BYTES = 1 << 17
"""Largest length of a message. Linux accepts datagrams of up to 200,000 bytes."""

WIRE_BYTES = MESSAGE_BYTES - (1 << 14)
"""Largest length of a wire with its caveats, as JSON.

The status holds the wire in force, and the request after a fit holds a new wire. The status also has up to 100,000
bytes of events, and must not exceed the `STATUS_BYTES` of the shared memory.
"""

MESSAGES_PER_TICK = 4


CHANNEL = np.dtype(
    [
        *((name, STREAM[name]) for name in STREAM.names or ()),
        ("off_count", "i8"),
        ("open_pages", "i8"),
        ("is_controlled", "i8"),
        ("page_pid", "i8"),
        ("page_beat_ns", "i8"),
        ("front_beats", "i8"),
    ]
)
"""The layout of the shared memory: rows and status, then the counters of the channel."""


def check_wire(text: str, caveats: Sequence[str], where: str) -> None:
    """Raise ConfigError if the wire is longer than `WIRE_BYTES`. `text` is its text, and `where` is its file."""
    size = len(json.dumps([text, *caveats]))
    if size > WIRE_BYTES:
        raise _too_long(where, size, WIRE_BYTES)


class MessageLink:
    """One of the two connected sockets of the channel."""

    def __init__(self, messages: socket.socket) -> None:
        self.messages = messages
        messages.setblocking(False)

    def send(self, message: dict[str, Any]) -> bool:
        """Send a message. Return False if the other end is closed, or its queue is full.

        ConfigError if the message is longer than `MESSAGE_BYTES`: the other end would get only a part of it.
        """
        content = json.dumps(message).encode()
        if len(content) > MESSAGE_BYTES:
            raise _too_long("message", len(content), MESSAGE_BYTES)
        with suppress(OSError):
            return self.messages.send(content) > 0
        return False

    def received(self, limit: int) -> Iterator[bytes]:
        """Yield the messages that have arrived, at most `limit` of them."""
        for _ in range(limit):
            try:
                yield self.messages.recv(MESSAGE_BYTES)
            except OSError:
                return


class DriverEnd(SharedWriter, MessageLink):
    """The end of the channel in the driver, a context manager.

    No method waits, and no message of a page makes a method fail. `offs` is the OFF count at the last call of
    `off_requested`. `published` is the latest status.
    """

    layout = CHANNEL

    def __init__(self) -> None:
        SharedWriter.__init__(self)
        self.page_socket, own = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        MessageLink.__init__(self, own)
        self.offs = 0

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the sockets and the descriptor; mapped memory stays usable."""
        self.messages.close()
        self.page_socket.close()
        super().__exit__(kind, error, trace)

    @property
    def pages(self) -> tuple[int, bool]:
        """The number of open pages, and True if one of them may change the session."""
        return self._count("open_pages"), bool(self._count("is_controlled"))

    @property
    def front_beats(self) -> int:
        """A counter that increases while the front process answers."""
        return self._count("front_beats")

    def off_requested(self) -> bool:
        """Return True if an OFF was counted since the last call. Set `offs` to the present OFF count."""
        count = self._count("off_count")
        is_new, self.offs = count != self.offs, count
        return is_new


class PageEnd(SharedReader, MessageLink):
    """The side of the channel that the page process and the front process use."""

    layout = CHANNEL

    def __init__(self, memory_fd: int, messages: socket.socket) -> None:
        SharedReader.__init__(self, memory_fd)
        MessageLink.__init__(self, messages)

    def request_off(self) -> None:
        """Count an OFF, which the loop sees at its next tick."""
        self._increase("off_count")

    @property
    def offs(self) -> int:
        """The OFF count: the number of OFFs since the session began."""
        return self._count("off_count")

    def report_pages(self, count: int, *, is_controlled: bool) -> None:
        """Report the number of open pages. `is_controlled` is True if one of them may change the session."""
        self._block["open_pages"], self._block["is_controlled"] = count, is_controlled

    @property
    def pages_open(self) -> int:
        """The number of open pages, as the page process has reported it."""
        return self._count("open_pages")

    def beat(self) -> None:
        """Report that the page process, which calls this method, answers now."""
        self._block["page_pid"], self._block["page_beat_ns"] = os.getpid(), time.monotonic_ns()

    def beat_front(self) -> None:
        """Report that the front process, which calls this method, answers now."""
        self._increase("front_beats")

    def page_server(self, within_s: float) -> int | None:
        """Return the process id of the page process, or None if its last heartbeat is older than `within_s`."""
        age_s = 1e-9 * (time.monotonic_ns() - self._count("page_beat_ns"))
        return self._count("page_pid") if age_s < within_s else None


def _too_long(where: str, size: int, limit: int) -> ConfigError:
    cure = "identify a model with fewer sets or thresholds"
    return ConfigError("too long for the tuning page", where=where, value=f"{size} bytes", limit=limit, cure=cure)
