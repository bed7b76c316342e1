"""The simulated rig on a pseudo-terminal: to the program at the other end it is a serial port like any other.

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
import tty
from collections.abc import Iterator
from pathlib import Path

from firmware_sim.device import TICK_S, SimulatedDevice
from firmware_sim.faults import Delivery
from smadrive.errors import ConfigError

_CHUNK = 512


class Terminal:
    """A pseudo-terminal in raw mode. The far end stays open here, so that clients may come and go."""

    def __init__(self, link: Path | None) -> None:
        """Open it, and name it `link` too; ConfigError when that path is taken or cannot be made."""
        self.near, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self.near, False)
        self._link = link
        self.path = os.ttyname(self._far)
        if link is not None:
            try:
                _make_link(link, self.path)
            except ConfigError:
                self._link = None
                self.close()
                raise
            self.path = str(link.absolute())

    def close(self) -> None:
        """Close both ends and remove the link."""
        os.close(self.near)
        os.close(self._far)
        if self._link is not None:
            self._link.unlink(missing_ok=True)


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink() and not link.exists():
        link.unlink()  # left behind by a simulator that was killed
    try:
        link.symlink_to(target)
    except OSError as error:
        raise ConfigError(
            f"--pty {link}: cannot be made ({error.strerror}); remove it or choose another path"
        ) from None


class _Lines:
    """Complete lines from a descriptor, as bytes come."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode("ascii", "replace").strip() for line in lines]


class Server:
    """Moves bytes between a terminal and a rig until it is stopped."""

    def __init__(self, device: SimulatedDevice, terminal: Terminal) -> None:
        self._device = device
        self._terminal = terminal
        self._due: list[tuple[float, int, bytes]] = []
        self._order = 0

    def run_real(self) -> None:
        """Follow the monotonic clock, in steps of 10 ms at most, until interrupted."""
        start_s = time.monotonic() - self._device.time_s
        while True:
            next_s = min(self._device.time_s + TICK_S, self._due[0][0] if self._due else math.inf)
            wait_s = max(start_s + next_s - time.monotonic(), 0.0)
            ready, _, _ = select.select((self._terminal.near,), (), (), wait_s)
            self._pass_time(time.monotonic() - start_s)
            if ready:
                self._take_request()

    def run_driven(self) -> None:
        """Follow the times on standard input until it ends."""
        lines = _Lines()
        stdin = sys.stdin.fileno()
        while True:
            ready, _, _ = select.select((self._terminal.near, stdin), (), ())
            if self._terminal.near in ready:
                self._take_request()
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
            self._send(heapq.heappop(self._due)[2])

    def _take_request(self) -> None:
        for due_s, reply in self._device.receive(os.read(self._terminal.near, _CHUNK), self._device.time_s):
            self._schedule((due_s, reply))

    def _schedule(self, delivery: Delivery) -> None:
        due_s, reply = delivery
        if due_s <= self._device.time_s:
            self._send(reply)
        else:
            self._order += 1
            heapq.heappush(self._due, (due_s, self._order, reply))

    def _send(self, reply: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # nobody reads and the line is full: a real line loses it too
            os.write(self._terminal.near, reply)


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
