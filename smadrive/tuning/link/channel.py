"""What joins the control process and the page process, so that neither can hold the other up.

    control → page   samples    a ring of rows in shared memory; the page copies what is new, the oldest is overwritten
    control → page   status     one JSON document in shared memory, replaced as a whole
    page → control   off        a counter in shared memory: switching off needs no queue, no room, no answer;
                                what drives the wire is asked for with the count that was known (see presses);
                                the front process alone counts, so that no count is lost between two writers
    page → control   pages      two numbers in shared memory: how many pages are open, and whether one controls
    page → front     alive      two numbers in shared memory: the page process, and when it last read the channel
    front → control  beats      a counter in shared memory: the front process increments it as long as it answers
    both ways        messages   datagrams on a socket pair, each whole or not there; a full queue refuses, never waits

The memory has no name: both processes hold its file descriptor, so nothing is left behind whoever dies, when and how.
A reader that is interrupted by the writer sees that by the number of the row, or the version of the status, and takes
what is whole.
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from smadrive.control.loop import Tick

COLUMNS = (
    "time_s",
    "late_s",
    "temperature_c",
    "displacement_mm",
    "current_a",
    "voltage_v",
    "setpoint_c",
    "setpoint_mm",
    "estimated_c",
    "estimated_mm",
    "power_w",
    "commanded_a",
)
"""One row: what a tick measured, believed and commanded; `time_s` since the session began."""

Row = tuple[float, ...]

CAPACITY = 1 << 15
"""Rows kept: 27 minutes at 20 Hz."""

STATUS_BYTES = 1 << 18
MESSAGE_BYTES = 1 << 16
MESSAGES_PER_TICK = 4

_WRITTEN, _OFF, _VERSION, _LENGTH, _PAGES, _CONTROLLED, _SERVER, _BEAT_NS, _FRONT_BEATS, _HEADER = range(10)
_SIZE = 8 * _HEADER + STATUS_BYTES + 8 * CAPACITY * (1 + len(COLUMNS))

Rows = NDArray[np.float64]


def row_of(tick: Tick, began_s: float) -> Row:
    """The `COLUMNS` of a tick of a session that began at `began_s`."""
    measurement, command = tick.measurement, tick.command
    return (
        measurement.time_s - began_s,
        tick.late_s,
        measurement.temperature_c,
        measurement.displacement_mm,
        measurement.current_a,
        measurement.voltage_v,
        command.setpoint_c,
        command.setpoint_mm,
        command.estimated_c,
        command.estimated_mm,
        command.power_w,
        command.commanded_a,
    )


class Channel:
    """Both ends' view of the memory and one end of the socket."""

    def __init__(self, memory_fd: int, messages: socket.socket) -> None:
        self.memory_fd = memory_fd
        self.messages = messages
        messages.setblocking(False)
        memory = mmap.mmap(memory_fd, _SIZE)
        self._header = np.frombuffer(memory, np.int64, _HEADER)
        self._status = np.frombuffer(memory, np.uint8, STATUS_BYTES, 8 * _HEADER)
        rows = np.frombuffer(memory, np.float64, offset=8 * _HEADER + STATUS_BYTES)
        self._rows = rows.reshape(CAPACITY, 1 + len(COLUMNS))  # the first column is the row's number

    def send(self, message: dict[str, Any]) -> bool:
        """Whether the message could be sent: not when the other end is gone, or does not read what it has."""
        with suppress(OSError):
            return self.messages.send(json.dumps(message).encode()) > 0
        return False

    def received(self, most: int) -> Iterator[bytes]:
        """The messages that have arrived, `most` of them at once."""
        for _ in range(most):
            try:
                yield self.messages.recv(MESSAGE_BYTES)
            except OSError:
                return


class ControlEnd(Channel):
    """The end of the control process. Nothing here waits, and nothing here fails because of the page."""

    def __init__(self) -> None:
        self.page_socket, own = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        super().__init__(anonymous_memory(_SIZE), own)
        self.offs = 0
        self.published: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Use as a context: the sockets and the memory are closed at its end; what is still mapped stays usable."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.messages.close()
        self.page_socket.close()
        os.close(self.memory_fd)

    def append(self, row: Row) -> None:
        """One row of `COLUMNS`."""
        number = int(self._header[_WRITTEN])
        place = self._rows[number % CAPACITY]
        place[0] = -1.0
        place[1:] = row
        place[0] = number
        self._header[_WRITTEN] = number + 1

    def publish(self, status: dict[str, Any]) -> None:
        """Replace the status; one that is too long is a defect and raises ValueError. `published` is the latest."""
        self.published = status
        text = np.frombuffer(json.dumps(status).encode(), np.uint8)
        self._header[_VERSION] += 1  # odd while it is being written
        self._status[: text.size] = text
        self._header[_LENGTH] = text.size
        self._header[_VERSION] += 1

    @property
    def pages(self) -> tuple[int, bool]:
        """How many pages are open, and whether one of them controls."""
        return int(self._header[_PAGES]), bool(self._header[_CONTROLLED])

    @property
    def front_beats(self) -> int:
        """Increases as long as the front process answers."""
        return int(self._header[_FRONT_BEATS])

    def off_requested(self) -> bool:
        """Whether a page has asked to switch off since this was last asked; `offs` is how many times by now."""
        count = int(self._header[_OFF])
        asked, self.offs = count != self.offs, count
        return asked


class PageEnd(Channel):
    """The end of the page process."""

    def request_off(self) -> None:
        """Ask to switch off; the loop sees it at its next tick."""
        self._header[_OFF] += 1

    @property
    def offs(self) -> int:
        """How many times switching off has been asked for."""
        return int(self._header[_OFF])

    def tell_pages(self, count: int, *, is_controlled: bool) -> None:
        """How many pages are open, and whether one of them controls."""
        self._header[_PAGES], self._header[_CONTROLLED] = count, is_controlled

    @property
    def pages_open(self) -> int:
        """How many pages are open."""
        return int(self._header[_PAGES])

    def beat(self) -> None:
        """Leave word that this process, the page process, answers now."""
        self._header[_SERVER], self._header[_BEAT_NS] = os.getpid(), time.monotonic_ns()

    def beat_front(self) -> None:
        """Leave word that the front process answers now."""
        self._header[_FRONT_BEATS] += 1

    def page_server(self, within_s: float) -> int | None:
        """The page process that has answered within this time; None if there is none."""
        age_s = 1e-9 * (time.monotonic_ns() - int(self._header[_BEAT_NS]))
        return int(self._header[_SERVER]) if age_s < within_s else None

    @property
    def written(self) -> int:
        """How many rows there have ever been."""
        return int(self._header[_WRITTEN])

    def since(self, number: int) -> tuple[int, Rows]:
        """The rows from `number` on that are still there, (rows, columns), and the number to go on from."""
        written = self.written
        numbers = np.arange(max(number, written - CAPACITY + 1), written)
        places = numbers % CAPACITY
        rows = self._rows[places]
        whole = (rows[:, 0] == numbers) & (self._rows[places, 0] == numbers)
        return written, rows[whole, 1:]

    def status(self, seen: int) -> tuple[int, dict[str, Any]] | None:
        """Version and content of the status; None before the first, for version `seen`, and while it is written."""
        version = int(self._header[_VERSION])
        if version in (0, seen) or version % 2:
            return None
        text = self._status[: int(self._header[_LENGTH])].tobytes()
        if int(self._header[_VERSION]) != version:
            return None
        return version, json.loads(text)


def anonymous_memory(size: int) -> int:
    """The descriptor of a memory without a name; it can grow."""
    if hasattr(os, "memfd_create"):
        memory_fd = os.memfd_create("smadrive-tuning")
    else:
        with tempfile.TemporaryFile() as file:
            memory_fd = os.dup(file.fileno())
    os.truncate(memory_fd, size)
    return memory_fd
