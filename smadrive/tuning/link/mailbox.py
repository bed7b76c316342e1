"""Parcels between two processes, one at a time each way, that are handed over without waiting.

A parcel lies in memory of both; a datagram with its number and length says that it is there. Pipe and socket hold only
so much: whoever sends or fetches more through them waits for the other side, which may have lost its processor.
"""

from __future__ import annotations

import os
import socket
import struct
from contextlib import suppress
from typing import NamedTuple, Self

from smadrive.tuning.link.channel import anonymous_memory

_HEAD = struct.Struct("qq")


class Parcel(NamedTuple):
    """What was sent under this number."""

    number: int
    content: bytes


class Parcels:
    """One end: `outgoing_fd` and `incoming_fd` are the memories, `messages` the socket."""

    def __init__(self, outgoing_fd: int, incoming_fd: int, messages: socket.socket) -> None:
        self._outgoing_fd = outgoing_fd
        self._incoming_fd = incoming_fd
        self.messages = messages
        messages.setblocking(False)

    def send(self, number: int, content: bytes) -> bool:
        """Whether it could be sent. The parcel before it must have been received: it lay in the same place."""
        with suppress(OSError):
            if os.pwrite(self._outgoing_fd, content, 0) == len(content):
                return self.messages.send(_HEAD.pack(number, len(content))) > 0
        return False

    def received(self) -> Parcel | None:
        """The parcel that has arrived, if one has."""
        try:
            number, length = _HEAD.unpack(self.messages.recv(_HEAD.size))
        except OSError:
            return None
        return Parcel(number, os.pread(self._incoming_fd, length, 0))


class ParcelPair(Parcels):
    """The first end, which makes the second: `fds` is what the other process gets. A context manager."""

    def __init__(self) -> None:
        self._theirs, own = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        super().__init__(anonymous_memory(0), anonymous_memory(0), own)

    @property
    def fds(self) -> tuple[int, int, int]:
        """Outgoing memory, incoming memory and socket of the other end."""
        return self._incoming_fd, self._outgoing_fd, self._theirs.fileno()

    def __enter__(self) -> Self:
        """Use as a context: memory and sockets are closed at its end."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.messages.close()
        self._theirs.close()
        os.close(self._outgoing_fd)
        os.close(self._incoming_fd)


def other_end(fds: tuple[int, int, int]) -> Parcels:
    """The second end, in the other process, from the `fds` of the first."""
    outgoing_fd, incoming_fd, socket_fd = fds
    return Parcels(outgoing_fd, incoming_fd, socket.socket(fileno=socket_fd))
