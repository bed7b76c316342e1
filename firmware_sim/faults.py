"""Faults of the bus, on demand: what happens to the next replies."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

Delivery = tuple[float, bytes]  # when it arrives (seconds of the device), what arrives


class BusFaults:
    """Applied to replies in the order of the calls; a reply without a fault passes. The device answers in order."""

    def __init__(self) -> None:
        self._planned: deque[Callable[[float, bytes], list[Delivery]]] = deque()
        self._busy_until_s = 0.0

    def drop(self, replies: int = 1) -> None:
        """The next replies never arrive."""
        self._plan(replies, lambda _time_s, _frame: [])

    def delay(self, delay_s: float, replies: int = 1) -> None:
        """The next replies arrive late, and so do those behind them."""
        self._plan(replies, lambda time_s, frame: [(time_s + delay_s, frame)])

    def corrupt(self, replies: int = 1) -> None:
        """A bit of the next replies is flipped: their CRC is wrong."""
        self._plan(replies, lambda time_s, frame: [(time_s, frame[:-3] + bytes((frame[-3] ^ 1,)) + frame[-2:])])

    def truncate(self, replies: int = 1) -> None:
        """The second half of the next replies is missing."""
        self._plan(replies, lambda time_s, frame: [(time_s, frame[: len(frame) // 2])])

    def replace(self, forge: Callable[[bytes], bytes], replies: int = 1) -> None:
        """The next replies are what `forge` makes of them (another unit, function or count, junk around them)."""
        self._plan(replies, lambda time_s, frame: [(time_s, forge(frame))])

    def apply(self, frame: bytes, time_s: float) -> list[Delivery]:
        """What becomes of the reply `frame`, sent at `time_s`."""
        planned = self._planned.popleft() if self._planned else None
        deliveries = [(time_s, frame)] if planned is None else planned(time_s, frame)
        in_order = []
        for due_s, data in deliveries:
            self._busy_until_s = max(due_s, self._busy_until_s)
            in_order.append((self._busy_until_s, data))
        return in_order

    def _plan(self, replies: int, fault: Callable[[float, bytes], list[Delivery]]) -> None:
        self._planned.extend([fault] * replies)
