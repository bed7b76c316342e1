"""Faults of the bus, on demand: what happens to the next replies of a device, and to the connections that lead to it.

    one reply    drop, delay, duplicate, corrupt, truncate, junk_before, junk_after, wrong_unit, wrong_function,
                 short_count, refuse, defer, split, early, stale
    the line     noise (bytes that nobody sent), vanish (the port is gone, and comes back)

Faults of replies hold for the next `replies`, or `for_s` seconds from now; a reply suffers the first that still holds.
A request is carried out although its reply is lost or spoilt; one that is refused is not. The device answers in order:
what comes behind a late reply is late too.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Annotated, Protocol

from pydantic import Field

from firmware_sim.bus.message import Message

Delivery = tuple[float, bytes]  # when it arrives (seconds of the device), what arrives
Alter = Callable[[Message], list[Delivery]]  # what is sent instead of a reply, and how much later
Carry = Callable[[bytes], list[Delivery]]  # what arrives of a frame that is sent, and how much later

Seconds = Annotated[float, Field(gt=0)]
Later = Annotated[float, Field(ge=0)]
Replies = Annotated[int, Field(ge=1)]
Pieces = Annotated[int, Field(ge=2)]
Code = Annotated[int, Field(ge=1, le=0xFF)]

JUNK_BYTES = 3
FAULTS = (
    *("drop", "delay", "duplicate", "corrupt", "truncate", "junk_before", "junk_after", "wrong_unit"),
    *("wrong_function", "short_count", "refuse", "defer", "split", "early", "stale", "noise", "vanish"),
)


class Ear(Protocol):
    """The client's end of a connection to the device."""

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` arrive at `due_s`, though nobody asked."""
        ...

    def disconnect(self, return_s: float) -> None:
        """The connection is gone; another one is possible from `return_s`."""
        ...


def _reply(reply: Message) -> list[Delivery]:
    return [(0.0, reply.frame)]


def _whole(frame: bytes) -> list[Delivery]:
    return [(0.0, frame)]


@dataclass(slots=True)
class _Spell:
    """A fault, and how long it holds. `code`: the request is refused with it."""

    left: float
    until_s: float
    alter: Alter = _reply
    carry: Carry = _whole
    code: int | None = None

    def spoil(self, reply: Message) -> list[Delivery]:
        """What arrives of `reply`."""
        return [(sent_s + late_s, data) for sent_s, frame in self.alter(reply) for late_s, data in self.carry(frame)]


_NO_FAULT = _Spell(left=inf, until_s=inf)


class BusFaults:
    """What goes wrong between one device and its clients, which `connect` makes known."""

    def __init__(self, now_s: Callable[[], float], seed: int = 0) -> None:
        """`now_s` tells the time of the device; `seed` is that of junk and noise."""
        self._ears: list[Ear] = []
        self._noisy: list[Ear] = []
        self.before_reply: Callable[[], None] = lambda: None
        self._now_s = now_s
        self._random = random.Random(seed)
        self._planned: deque[_Spell] = deque()
        self._busy_until_s = 0.0
        self._before = b""

    def connect(self, ear: Ear, *, numbered: bool) -> None:
        """Let the faults of the line reach `ear`; no noise where frames are numbered: TCP guards its bytes itself."""
        self._ears.append(ear)
        if not numbered:
            self._noisy.append(ear)

    def drop(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies never arrive."""
        self._plan(replies, for_s, carry=lambda _frame: [])

    def delay(self, delay_s: Seconds, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive `delay_s` late, and so do those behind them."""
        self._plan(replies, for_s, carry=lambda frame: [(delay_s, frame)])

    def duplicate(self, after_s: Later = 0.0, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive twice, the second time `after_s` after the first; 0: in one piece."""

        def twice(frame: bytes) -> list[Delivery]:
            return [(0.0, frame), (after_s, frame)] if after_s else [(0.0, 2 * frame)]

        self._plan(replies, for_s, carry=twice)

    def corrupt(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """A bit flips: the CRC is wrong. TCP guards its payload itself, so there it is a bit of the header."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.damaged(self._random.random()))])

    def truncate(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The second half is missing."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, frame[: len(frame) // 2])])

    def junk_before(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive right before the reply."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, self._random.randbytes(JUNK_BYTES) + frame)])

    def junk_after(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive right behind the reply."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, frame + self._random.randbytes(JUNK_BYTES))])

    def wrong_unit(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Another unit seems to answer."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.from_another_unit.frame)])

    def wrong_function(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is that to another function."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.of_another_function.frame)])

    def short_count(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is in itself right, and carries less than was asked for."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.of_less.frame)])

    def refuse(self, code: Code, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Requests are not carried out but answered with exception `code`."""
        self._plan(replies, for_s, code=code)

    def defer(self, code: Code, after_s: Later, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Exception `code` arrives first, the real reply `after_s` later: a gateway that did not wait long enough."""

        def twice(reply: Message) -> list[Delivery]:
            return [(0.0, reply.answered(reply.refused(code)).frame), (after_s, reply.frame)]

        self._plan(replies, for_s, twice)

    def early(self, after_s: Later, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Behind the reply comes one that nobody asked for yet; over TCP it has the next transaction number."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.frame), (after_s, reply.of_next.frame)])

    def split(self, pause_s: Seconds, pieces: Pieces = 2, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive in `pieces`, with a pause after each."""

        def cut(frame: bytes) -> list[Delivery]:
            bounds = [len(frame) * piece // pieces for piece in range(pieces + 1)]
            return [(at * pause_s, frame[bounds[at] : bounds[at + 1]]) for at in range(pieces)]

        self._plan(replies, for_s, carry=cut)

    def stale(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is the one before it, as from a gateway that caches: right in all but its content."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.answered(self._before).frame)])

    def combine_planned(self) -> None:
        """Make one fault of the last two that were planned: what the first sends suffers the second on its way."""
        second, first = self._planned.pop(), self._planned.pop()
        self._planned.append(_Spell(first.left, first.until_s, first.spoil, second.carry, first.code))

    def noise(self, for_s: Seconds, gap_s: Seconds = 0.05) -> None:
        """For a while random bytes arrive, on average every `gap_s`; none over Modbus TCP."""
        time_s = self._now_s()
        end_s = time_s + for_s
        while (time_s := time_s + self._random.expovariate(1 / gap_s)) < end_s:
            for ear in self._noisy:
                ear.deliver(time_s, self._random.randbytes(self._random.randint(1, JUNK_BYTES)))

    def vanish(self, for_s: Seconds) -> None:
        """Every connection is lost, and none can be made for a while: the adapter is out, the gateway restarts."""
        for ear in self._ears:
            ear.disconnect(self._now_s() + for_s)

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Every fault there is."""
        return {name: getattr(self, name) for name in FAULTS}

    def clear(self) -> None:
        """Nothing that was planned for replies happens any more."""
        self._planned.clear()

    def answer(self, request: Message, carry_out: Callable[[bytes], bytes], time_s: float) -> list[Delivery]:
        """What arrives as the answer to `request` at `time_s`, which `carry_out` turns into a reply, or does not."""
        self.before_reply()
        spell = self._next(time_s)
        pdu = carry_out(request.pdu) if spell.code is None else request.refused(spell.code)
        deliveries = spell.spoil(request.answered(pdu))
        self._before = pdu
        return self._in_order(time_s, deliveries)

    def _plan(
        self,
        replies: int,
        for_s: float | None,
        alter: Alter = _reply,
        carry: Carry = _whole,
        code: int | None = None,
    ) -> None:
        left, until_s = (replies, inf) if for_s is None else (inf, self._now_s() + for_s)
        self._planned.append(_Spell(left, until_s, alter, carry, code))

    def _next(self, time_s: float) -> _Spell:
        while self._planned:
            spell = self._planned[0]
            if spell.left > 0 and time_s < spell.until_s:
                spell.left -= 1
                return spell
            self._planned.popleft()
        return _NO_FAULT

    def _in_order(self, time_s: float, deliveries: list[Delivery]) -> list[Delivery]:
        in_order = []
        for later_s, data in deliveries:
            self._busy_until_s = max(time_s + later_s, self._busy_until_s)
            in_order.append((self._busy_until_s, data))
        return in_order
