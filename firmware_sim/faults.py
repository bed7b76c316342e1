"""Faults of the bus, on demand: what happens to the next replies of a device, and to the connections that lead to it.

    one reply    drop, delay, duplicate, corrupt, truncate, junk_before, junk_after, wrong_unit, wrong_function,
                 short_count, refuse, split, stale
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

from firmware_sim.message import Message

Delivery = tuple[float, bytes]  # when it arrives (seconds of the device), what arrives
Spoil = Callable[[Message], list[Delivery]]  # what arrives instead of a reply, and how much later

Seconds = Annotated[float, Field(gt=0)]
Later = Annotated[float, Field(ge=0)]
Replies = Annotated[int, Field(ge=1)]
Pieces = Annotated[int, Field(ge=2)]
Code = Annotated[int, Field(ge=1, le=0xFF)]

JUNK_BYTES = 3
FAULTS = (
    *("drop", "delay", "duplicate", "corrupt", "truncate", "junk_before", "junk_after", "wrong_unit"),
    *("wrong_function", "short_count", "refuse", "split", "stale", "noise", "vanish"),
)


class Ear(Protocol):
    """The client's end of a connection to the device."""

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` arrive at `due_s`, though nobody asked."""
        ...

    def lose(self, return_s: float) -> None:
        """The connection is gone; another one is possible from `return_s`."""
        ...


@dataclass(slots=True)
class _Spell:
    """A fault, and how long it holds. `code`: the request is refused with it."""

    spoil: Spoil
    left: float
    until_s: float
    code: int | None


def _pass(reply: Message) -> list[Delivery]:
    return [(0.0, reply.frame)]


_NO_FAULT = _Spell(_pass, left=inf, until_s=inf, code=None)


class BusFaults:
    """What goes wrong between one device and its clients. `ears`: where noise is heard and connections are lost."""

    def __init__(self, now_s: Callable[[], float], seed: int = 0) -> None:
        """`now_s` tells the time of the device; `seed` is that of junk and noise."""
        self.ears: list[Ear] = []
        self.before_reply: Callable[[], None] = lambda: None
        self._now_s = now_s
        self._random = random.Random(seed)
        self._planned: deque[_Spell] = deque()
        self._busy_until_s = 0.0
        self._before = b""

    def drop(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies never arrive."""
        self._plan(lambda _reply: [], replies, for_s)

    def delay(self, delay_s: Seconds, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive `delay_s` late, and so do those behind them."""
        self._plan(lambda reply: [(delay_s, reply.frame)], replies, for_s)

    def duplicate(self, after_s: Later = 0.0, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive twice, the second time `after_s` after the first; 0: in one piece."""

        def twice(reply: Message) -> list[Delivery]:
            return [(0.0, reply.frame), (after_s, reply.frame)] if after_s else [(0.0, 2 * reply.frame)]

        self._plan(twice, replies, for_s)

    def corrupt(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """A bit flips: the CRC is wrong. TCP guards its payload itself, so there it is a bit of the header."""
        self._plan(lambda reply: [(0.0, reply.damaged(self._random.random()))], replies, for_s)

    def truncate(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The second half is missing."""
        self._plan(lambda reply: [(0.0, reply.frame[: len(reply.frame) // 2])], replies, for_s)

    def junk_before(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive right before the reply."""
        self._plan(lambda reply: [(0.0, self._random.randbytes(JUNK_BYTES) + reply.frame)], replies, for_s)

    def junk_after(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive right behind the reply."""
        self._plan(lambda reply: [(0.0, reply.frame + self._random.randbytes(JUNK_BYTES))], replies, for_s)

    def wrong_unit(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Another unit seems to answer."""
        self._plan(lambda reply: [(0.0, reply.from_another_unit.frame)], replies, for_s)

    def wrong_function(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is that to another function."""
        self._plan(lambda reply: [(0.0, reply.of_another_function.frame)], replies, for_s)

    def short_count(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is in itself right, and carries less than was asked for."""
        self._plan(lambda reply: [(0.0, reply.of_less.frame)], replies, for_s)

    def refuse(self, code: Code, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Requests are not carried out but answered with exception `code`."""
        self._plan(_pass, replies, for_s, code)

    def split(self, pause_s: Seconds, pieces: Pieces = 2, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive in `pieces`, with a pause after each."""

        def cut(reply: Message) -> list[Delivery]:
            bounds = [len(reply.frame) * piece // pieces for piece in range(pieces + 1)]
            return [(at * pause_s, reply.frame[bounds[at] : bounds[at + 1]]) for at in range(pieces)]

        self._plan(cut, replies, for_s)

    def stale(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is the one before it, as from a gateway that caches: right in all but its content."""
        self._plan(lambda reply: [(0.0, reply.answered(self._before).frame)], replies, for_s)

    def noise(self, for_s: Seconds, gap_s: Seconds = 0.05) -> None:
        """For a while random bytes arrive, on average every `gap_s`."""
        time_s = self._now_s()
        end_s = time_s + for_s
        while (time_s := time_s + self._random.expovariate(1 / gap_s)) < end_s:
            for ear in self.ears:
                ear.deliver(time_s, self._random.randbytes(self._random.randint(1, JUNK_BYTES)))

    def vanish(self, for_s: Seconds) -> None:
        """Every connection is lost, and none can be made for a while: the adapter is out, the gateway restarts."""
        for ear in self.ears:
            ear.lose(self._now_s() + for_s)

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

    def _plan(self, spoil: Spoil, replies: int, for_s: float | None, code: int | None = None) -> None:
        left, until_s = (replies, inf) if for_s is None else (inf, self._now_s() + for_s)
        self._planned.append(_Spell(spoil, left, until_s, code))

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
