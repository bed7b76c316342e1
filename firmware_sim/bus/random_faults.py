"""Random faults of the bus for fuzzing. The same seed gives the same faults."""

from __future__ import annotations

import random
from collections.abc import Callable

from firmware_sim.bus.faults import BusFaults

CODES = (1, 2, 3, 4, 5, 6, 0x0B)
PIECES = range(2, 6)
RARE = 0.02  # fraction of the faults that affect more than one reply
MIXED = 0.1  # fraction of the other faults that are two faults at once
LAGGING = range(2, 30)  # number of successive replies that each repeat the previous reply


class RandomBusFaults:
    """Plans a fault before each reply with probability `share`. No delay and no absence is longer than `slowest_s`.

    With `copies`, a copy of a reply may also arrive after the next request. A client of plain RTU cannot detect this
    copy. With `lag`, several replies in a row may each repeat the previous reply. A client cannot detect this on RTU
    or on Modbus TCP. `reboot` restarts the device.
    """

    def __init__(
        self,
        faults: BusFaults,
        reboot: Callable[[], None],
        share: float,
        slowest_s: float,
        seed: int,
        *,
        copies: bool = False,
        lag: bool = False,
    ) -> None:
        self._random = random.Random(seed)
        self._share = share
        self._slowest_s = slowest_s
        self._faults = faults
        self._altering: tuple[Callable[[], None], ...] = (
            faults.corrupt,
            faults.wrong_unit,
            faults.wrong_function,
            faults.short_count,
            lambda: faults.refuse(self._code()),
            lambda: faults.defer(self._code(), self._some_s()),
        )
        self._carrying: tuple[Callable[[], None], ...] = (
            faults.drop,
            lambda: faults.delay(self._some_s()),
            faults.duplicate,  # at once: a later copy would be a valid reply to the next equal request on RTU
            faults.truncate,
            faults.junk_before,
            faults.junk_after,
            lambda: faults.split(self._some_s() / PIECES.stop, self._random.choice(PIECES)),
        )
        self._rare: tuple[Callable[[], None], ...] = (
            lambda: faults.noise(self._some_s(), gap_s=self._slowest_s / 10),
            lambda: faults.vanish(self._some_s()),
            reboot,
        )
        if copies:
            self._altering += (lambda: faults.early(self._some_s()),)
            self._carrying += (lambda: faults.duplicate(self._some_s()),)
        if lag:
            self._rare += (lambda: faults.stale(self._random.choice(LAGGING)),)
        faults.before_reply = self._plan

    def _plan(self) -> None:
        if self._random.random() >= self._share:
            return
        if self._random.random() < RARE:
            self._random.choice(self._rare)()
        elif self._random.random() < MIXED:
            self._random.choice(self._altering)()
            self._random.choice(self._carrying)()
            self._faults.combine_planned()
        else:
            self._random.choice(self._altering + self._carrying)()

    def _code(self) -> int:
        return self._random.choice(CODES)

    def _some_s(self) -> float:
        return self._random.uniform(0.0, self._slowest_s)
