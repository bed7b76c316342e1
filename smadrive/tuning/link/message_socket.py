"""A ZeroMQ socket between two processes, which sends and receives whole messages of any size without waiting.

A thread of ZeroMQ moves the bytes. It runs no Python code, so it works while the interpreter is busy. The connecting
end may be opened before the listening end, and may stay open after the listening end has closed: messages wait until a
process listens again.
See docs/decisions/0001-processes-of-the-tuning-page.md.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Self

import zmq


class MessageSocket:
    """One end of the connection at `address`, which is `ipc://PATH`. A context manager.

    Of the two ends, one is created with `listens` True, the other with False. A message is a list of parts. If the
    receiver unpickles messages, no other user may have access to the folder of PATH: unpickling can execute any code.
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
        """Close the socket. Messages that were not delivered are dropped."""
        self._socket.close()
        self._context.term()

    def send(self, *parts: bytes) -> None:
        """Send a message. The message is dropped if a thousand messages already wait."""
        with suppress(zmq.Again):
            self._socket.send_multipart(parts, zmq.NOBLOCK)

    def received(self) -> list[bytes] | None:
        """Return the parts of the next message that has arrived, or None if there is none."""
        try:
            return self._socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return None

    def wait(self, fd: int) -> bool:
        """Wait until a message arrives or `fd` becomes readable. Return True if `fd` is readable."""
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(fd, zmq.POLLIN)
        return fd in dict(poller.poll())
