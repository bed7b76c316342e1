"""Time as an argument: the one clock that a loop, a device and a simulated plant share.

A loop calls `now_s` and `sleep_until`, never the clock of the machine. `MonotonicClock` is real time. `VirtualClock`
advances when `sleep_until` is called: it jumps, and every follower of this clock (an in-process plant, a simulated
device in another process) gets the new time before the call returns. So the same program runs in real time with
`MonotonicClock`. With `VirtualClock` it runs as fast as the machine can compute, and every run is the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    """Seconds since an arbitrary origin, never going back."""

    def now_s(self) -> float:
        """Return the present time, in seconds."""
        ...

    def sleep_until(self, time_s: float) -> None:
        """Return when `now_s()` has reached `time_s`. Return at once if `time_s` is past."""
        ...


class MonotonicClock:
    """Real time: the machine's monotonic clock."""

    def now_s(self) -> float:
        """Return the time of the machine's monotonic clock, in seconds."""
        return time.monotonic()

    def sleep_until(self, time_s: float) -> None:
        """Sleep until `time_s`. Return at once if `time_s` is past."""
        remaining_s = time_s - time.monotonic()
        if remaining_s > 0:
            time.sleep(remaining_s)


class VirtualClock:
    """Time that advances only in `sleep_until`."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._followers: list[Callable[[float], None]] = []

    def now_s(self) -> float:
        """Return the virtual time, in seconds."""
        return self._now_s

    def sleep_until(self, time_s: float) -> None:
        """Jump to `time_s` and call every follower. Do nothing if `time_s` is past."""
        if time_s > self._now_s:
            self._now_s = time_s
            for follower in self._followers:
                follower(time_s)

    def follow(self, advance_to: Callable[[float], None]) -> None:
        """Call `advance_to(time_s)` at every jump, so that a simulated plant has the time of its controller."""
        self._followers.append(advance_to)
