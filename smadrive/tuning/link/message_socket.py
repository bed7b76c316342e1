"""A socket between two processes that sends and receives whole messages of any size without waiting (ZeroMQ).

A thread of ZeroMQ, which needs no interpreter, moves the bytes. The connecting end may exist before the listening one,
and outlives it: its messages wait until a process listens again.
See docs/decisions/0001-processes-of-the-tuning-page.md.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Self

import zmq


class MessageSocket:
    """One end at `address`, `ipc://PATH`. A message is a list of parts. A context manager.

    The folder of PATH must belong to this user alone if messages are unpickled.
    """

    def __init__(self, address: str, *, listens: bool) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.linger = 0
        if listens:
            self._socket.bind(address)
        else:
            self._socket.connect(address)

    def __enter__(self) -> Self:
        """Return this end."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close; messages that were not delivered are dropped."""
        self._socket.close()
        self._context.term()

    def send(self, *parts: bytes) -> None:
        """Send a message. It is dropped when a thousand of them wait already."""
        with suppress(zmq.Again):
            self._socket.send_multipart(parts, zmq.NOBLOCK)

    def received(self) -> list[bytes] | None:
        """The next message that has arrived; None without one."""
        try:
            return self._socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return None

    def wait(self, fd: int) -> bool:
        """Wait until a message arrives or `fd` becomes readable; whether `fd` is."""
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(fd, zmq.POLLIN)
        return fd in dict(poller.poll())
