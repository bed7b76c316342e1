"""The simulated rig behind its doors, in time.

Time is either real, and the rig follows the machine's monotonic clock, or driven: a parent process writes the time to
standard input, a number a line, and gets the line back when the rig has reached it. Then a test or demo with the real
protocol on a real port is repeatable, and as fast as the machine computes.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Protocol

from firmware_sim.bus.faults import Ear
from firmware_sim.server.endpoint import Endpoint
from firmware_sim.server.readiness import readable
from smadrive.errors import ConfigError
from smadrive.files.number_text import parse_number, shortened

STEP_S = 0.01
_CHUNK = 512


class Simulated(Protocol):
    """What lives behind the doors."""

    @property
    def time_s(self) -> float:
        """Its time."""
        ...

    def advance_to(self, time_s: float) -> None:
        """Let its time reach `time_s`; nothing happens if it is past."""
        ...


class _Lines:
    """Complete lines from a descriptor, as bytes come."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode("ascii", "replace").strip() for line in lines]


class Server:
    """Moves bytes between doors and a rig until it is stopped."""

    def __init__(self, rig: Simulated, doors: Sequence[Endpoint]) -> None:
        self._rig = rig
        self._doors = doors
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order = 0

    def ear(self, door: Endpoint) -> Ear:
        """Where faults of the bus reach the clients of `door`."""
        return _DoorEar(door, self._do_at)

    def run_real(self) -> None:
        """Follow the monotonic clock, in steps of 10 ms at most, until interrupted."""
        start_s = time.monotonic() - self._rig.time_s
        while True:
            next_s = min(self._rig.time_s + STEP_S, self._agenda[0][0] if self._agenda else math.inf)
            doors = self._by_descriptor()
            ready = readable(doors, max(start_s + next_s - time.monotonic(), 0.0))
            self._pass_time(time.monotonic() - start_s)
            for descriptor in ready:
                self._take_request(doors[descriptor], descriptor)

    def run_driven(self) -> None:
        """Follow the times on standard input until it ends."""
        lines = _Lines()
        stdin = sys.stdin.fileno()
        while True:
            doors = self._by_descriptor()
            ready = readable((*doors, stdin), None)
            for descriptor in ready:
                if descriptor != stdin:
                    self._take_request(doors[descriptor], descriptor)
            if stdin in ready:
                data = os.read(stdin, _CHUNK)
                if not data:
                    return
                for line in lines.feed(data):
                    self._pass_time(_time_of(line))
                    sys.stdout.write(line + "\n")
                    sys.stdout.flush()

    def _by_descriptor(self) -> dict[int, Endpoint]:
        return {descriptor: door for door in self._doors for descriptor in door.descriptors()}

    def _pass_time(self, time_s: float) -> None:
        self._rig.advance_to(time_s)
        while self._agenda and self._agenda[0][0] <= self._rig.time_s:
            heapq.heappop(self._agenda)[2]()

    def _take_request(self, door: Endpoint, descriptor: int) -> None:
        heard = door.hear(descriptor)
        if heard is None:
            return
        for due_s, reply in heard.talk.port.receive(heard.data, self._rig.time_s):
            self._do_at(due_s, partial(heard.talk.send, reply))

    def _do_at(self, due_s: float, action: Callable[[], None]) -> None:
        if due_s <= self._rig.time_s:
            action()
        else:
            self._order += 1
            heapq.heappush(self._agenda, (due_s, self._order, action))


class _DoorEar:
    """The clients of one door."""

    def __init__(self, door: Endpoint, do_at: Callable[[float, Callable[[], None]], None]) -> None:
        self._door = door
        self._do_at = do_at

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` arrive at every client that is there now."""
        for talk in self._door.talks():
            self._do_at(due_s, partial(talk.send, data))

    def disconnect(self, return_s: float) -> None:
        """Close the door, with all clients; open it again at `return_s`."""
        self._door.close()
        self._do_at(return_s, self._door.open)


def _time_of(line: str) -> float:
    try:
        time_s = parse_number(line)
    except ValueError:
        time_s = math.nan
    if not math.isfinite(time_s):
        raise ConfigError(
            f"--time driven: standard input says {shortened(line)}; write the time in seconds, one number a line"
        )
    return time_s


@contextlib.contextmanager
def stop_on_signal() -> Iterator[None]:
    """SIGTERM ends the block like Ctrl-C: by KeyboardInterrupt."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
