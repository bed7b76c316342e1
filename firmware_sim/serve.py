"""The simulated rig behind a door, in time.

Time is either real, and the rig follows the machine's monotonic clock, or driven: a parent process writes the time to
standard input, a number a line, and gets the line back when the rig has reached it. Then a test or demo with the real
protocol on a real port is repeatable, and as fast as the machine computes.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import os
import select
import signal
import sys
import time
from collections.abc import Iterator

from firmware_sim.device import TICK_S, SimulatedDevice
from firmware_sim.doors import Door, Talk
from smadrive.errors import ConfigError

_CHUNK = 512


class _Lines:
    """Complete lines from a descriptor, as bytes come."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode("ascii", "replace").strip() for line in lines]


class Server:
    """Moves bytes between a door and a rig until it is stopped."""

    def __init__(self, device: SimulatedDevice, door: Door) -> None:
        self._device = device
        self._door = door
        self._due: list[tuple[float, int, Talk, bytes]] = []
        self._order = 0

    def run_real(self) -> None:
        """Follow the monotonic clock, in steps of 10 ms at most, until interrupted."""
        start_s = time.monotonic() - self._device.time_s
        while True:
            next_s = min(self._device.time_s + TICK_S, self._due[0][0] if self._due else math.inf)
            wait_s = max(start_s + next_s - time.monotonic(), 0.0)
            ready, _, _ = select.select(self._door.descriptors(), (), (), wait_s)
            self._pass_time(time.monotonic() - start_s)
            for descriptor in ready:
                self._take_request(descriptor)

    def run_driven(self) -> None:
        """Follow the times on standard input until it ends."""
        lines = _Lines()
        stdin = sys.stdin.fileno()
        while True:
            ready, _, _ = select.select([*self._door.descriptors(), stdin], (), ())
            for descriptor in ready:
                if descriptor != stdin:
                    self._take_request(descriptor)
            if stdin in ready:
                data = os.read(stdin, _CHUNK)
                if not data:
                    return
                for line in lines.feed(data):
                    self._pass_time(_time_of(line))
                    sys.stdout.write(line + "\n")
                    sys.stdout.flush()

    def _pass_time(self, time_s: float) -> None:
        self._device.advance_to(time_s)
        while self._due and self._due[0][0] <= self._device.time_s:
            _, _, talk, reply = heapq.heappop(self._due)
            talk.send(reply)

    def _take_request(self, descriptor: int) -> None:
        heard = self._door.hear(descriptor)
        if heard is None:
            return
        for due_s, reply in self._device.receive(heard.data, self._device.time_s, heard.talk.port):
            if due_s <= self._device.time_s:
                heard.talk.send(reply)
            else:
                self._order += 1
                heapq.heappush(self._due, (due_s, self._order, heard.talk, reply))


def _time_of(line: str) -> float:
    try:
        time_s = float(line)
    except ValueError:
        time_s = math.nan
    if not math.isfinite(time_s):
        raise ConfigError(f"--time driven: standard input says '{line}'; write the time in seconds, one number a line")
    return time_s


@contextlib.contextmanager
def stop_on_signal() -> Iterator[None]:
    """SIGTERM ends the block like Ctrl-C: by KeyboardInterrupt."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
