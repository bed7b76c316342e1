"""Faults of the bus by chance: what a fuzzer wants, the same for the same seed."""

from __future__ import annotations

import random
from collections.abc import Callable

from firmware_sim.faults import BusFaults

CODES = (1, 2, 3, 4, 5, 6, 0x0B)
PIECES = range(2, 6)
RARE = 0.02  # of the faults: those that cost more than a reply


class ChanceFaults:
    """Before each reply plans a fault with probability `share`; nothing takes longer than `slowest_s`."""

    def __init__(
        self, faults: BusFaults, reboot: Callable[[], None], share: float, slowest_s: float, seed: int
    ) -> None:
        self._random = random.Random(seed)
        self._share = share
        self._slowest_s = slowest_s
        self._common: tuple[Callable[[], None], ...] = (
            faults.drop,
            lambda: faults.delay(self._some_s()),
            faults.duplicate,  # at once: on RTU a second reply that comes behind the next request is the reply to it
            faults.corrupt,
            faults.truncate,
            faults.junk_before,
            faults.junk_after,
            faults.wrong_unit,
            faults.wrong_function,
            faults.short_count,
            lambda: faults.refuse(self._random.choice(CODES)),
            lambda: faults.split(self._some_s() / PIECES.stop, self._random.choice(PIECES)),
        )
        self._rare: tuple[Callable[[], None], ...] = (
            lambda: faults.noise(self._some_s(), gap_s=self._slowest_s / 10),
            lambda: faults.vanish(self._some_s()),
            reboot,
        )
        faults.before_reply = self._draw

    def _draw(self) -> None:
        if self._random.random() < self._share:
            rare = self._random.random() < RARE
            self._random.choice(self._rare if rare else self._common)()

    def _some_s(self) -> float:
        return self._random.uniform(0.0, self._slowest_s)
