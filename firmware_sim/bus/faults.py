"""Faults of the bus. They alter the next replies of a device, or the connections to the device.

    one reply    drop, delay, duplicate, corrupt, truncate, junk_before, junk_after, wrong_unit, wrong_function,
                 short_count, refuse, defer, split, early, stale
    the line     noise (random bytes), vanish (the port is gone, and comes back)

A fault of replies lasts for a number of `replies`, or for `for_s` seconds from now. Planned faults act one after the
other: a reply gets only the first fault that is not over yet. The device carries out a request even when the reply is
lost or corrupted. The only exception is `refuse`: the device does not carry out the request. Replies arrive in the
order of their requests, so a late reply also delays the replies after it.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Protocol

from firmware_sim.bus.message import Message
from firmware_sim.fault_parameters import Delay, ExceptionCode, Pieces, Replies, Seconds

Delivery = tuple[float, bytes]  # time of arrival (seconds of the device), and the bytes that arrive
Alter = Callable[[Message], list[Delivery]]  # frames that are sent instead of a reply, and their delays
Carry = Callable[[bytes], list[Delivery]]  # the bytes of a frame that arrive, and their delays

JUNK_BYTES = 3
FAULTS = (
    *("drop", "delay", "duplicate", "corrupt", "truncate", "junk_before", "junk_after", "wrong_unit"),
    *("wrong_function", "short_count", "refuse", "defer", "split", "early", "stale", "noise", "vanish"),
)


class FaultyConnection(Protocol):
    """A client's connection to the device. The faults of the line act on this interface."""

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` arrive at the client at `due_s`, without a request from the client."""
        ...

    def disconnect(self, return_s: float) -> None:
        """Close the connection. The client can connect again from `return_s`."""
        ...


def _reply(reply: Message) -> list[Delivery]:
    return [(0.0, reply.frame)]


def _whole(frame: bytes) -> list[Delivery]:
    return [(0.0, frame)]


@dataclass(slots=True)
class _PlannedFault:
    """A fault and its duration.

    With a `code`, the device does not carry out the request, and replies with the exception of this code.
    """

    replies_left: float
    until_s: float
    alter: Alter = _reply
    carry: Carry = _whole
    code: int | None = None

    def deliveries(self, reply: Message) -> list[Delivery]:
        """Return the bytes that arrive instead of `reply`, and their delays."""
        return [(sent_s + late_s, data) for sent_s, frame in self.alter(reply) for late_s, data in self.carry(frame)]


_NO_FAULT = _PlannedFault(replies_left=inf, until_s=inf)


class BusFaults:
    """The faults between one device and its clients. `connect` adds a client's connection."""

    def __init__(self, now_s: Callable[[], float], seed: int = 0) -> None:
        """`now_s` returns the time of the device; `seed` seeds the random bytes and the flipped bits."""
        self._connections: list[FaultyConnection] = []
        self._noisy: list[FaultyConnection] = []
        self.before_reply: Callable[[], None] = lambda: None
        self._now_s = now_s
        self._random = random.Random(seed)
        self._planned: deque[_PlannedFault] = deque()
        self._busy_until_s = 0.0
        self._previous_pdu = b""

    def connect(self, connection: FaultyConnection, *, numbered: bool) -> None:
        """Apply the faults of the line to `connection`.

        A `numbered` connection (Modbus TCP) gets no noise, because TCP protects its bytes.
        """
        self._connections.append(connection)
        if not numbered:
            self._noisy.append(connection)

    def drop(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies are lost."""
        self._plan(replies, for_s, carry=lambda _frame: [])

    def delay(self, delay_s: Seconds, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive `delay_s` late. Replies stay in order, so a late reply also delays the replies after it."""
        self._plan(replies, for_s, carry=lambda frame: [(delay_s, frame)])

    def duplicate(self, after_s: Delay = 0.0, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Every reply arrives twice, the second time `after_s` later. With 0 both copies arrive in one piece."""

        def twice(frame: bytes) -> list[Delivery]:
            return [(0.0, frame), (after_s, frame)] if after_s else [(0.0, 2 * frame)]

        self._plan(replies, for_s, carry=twice)

    def corrupt(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """One bit of the reply flips.

        In an RTU frame, a bit of the CRC flips. In a Modbus TCP frame, a bit of the header flips. In a line of text,
        any bit can flip.
        """
        self._plan(replies, for_s, lambda reply: [(0.0, reply.corrupted(self._random.random()))])

    def truncate(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Only the first half of the reply arrives."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, frame[: len(frame) // 2])])

    def junk_before(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive directly before the reply."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, self._random.randbytes(JUNK_BYTES) + frame)])

    def junk_after(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Random bytes arrive directly after the reply."""
        self._plan(replies, for_s, carry=lambda frame: [(0.0, frame + self._random.randbytes(JUNK_BYTES))])

    def wrong_unit(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply has the unit id of another device. A line of text becomes the reply of another kind of board."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.wrong_unit.frame)])

    def wrong_function(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply has another function code."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.wrong_function.frame)])

    def short_count(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply is a valid frame with less data than requested."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.short_count.frame)])

    def refuse(self, code: ExceptionCode, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The device does not carry out the request. The reply is the exception `code`."""
        self._plan(replies, for_s, code=code)

    def defer(self, code: ExceptionCode, after_s: Delay, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Exception `code` arrives first, the real reply `after_s` later: the timeout of a gateway is too short."""

        def twice(reply: Message) -> list[Delivery]:
            return [(0.0, reply.reply(reply.exception_pdu(code)).frame), (after_s, reply.frame)]

        self._plan(replies, for_s, twice)

    def early(self, after_s: Delay, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply arrives, and `after_s` later a copy of it, as an early reply to the next request.

        On Modbus TCP the copy has the next transaction number.
        """
        self._plan(replies, for_s, lambda reply: [(0.0, reply.frame), (after_s, reply.next_transaction.frame)])

    def split(self, pause_s: Seconds, pieces: Pieces = 2, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """Replies arrive in a number of `pieces`, with a pause of `pause_s` between two pieces."""

        def cut(frame: bytes) -> list[Delivery]:
            bounds = [len(frame) * piece // pieces for piece in range(pieces + 1)]
            return [(at * pause_s, frame[bounds[at] : bounds[at + 1]]) for at in range(pieces)]

        self._plan(replies, for_s, carry=cut)

    def stale(self, replies: Replies = 1, for_s: Seconds | None = None) -> None:
        """The reply repeats the content of the previous reply in a valid new frame, as from a gateway that caches."""
        self._plan(replies, for_s, lambda reply: [(0.0, reply.reply(self._previous_pdu).frame)])

    def combine_planned(self) -> None:
        """Combine the last two planned faults into one.

        The first fault alters the content of the reply. The second fault alters how the bytes of the reply arrive. The
        combined fault lasts as long as the first fault.
        """
        second, first = self._planned.pop(), self._planned.pop()
        self._planned.append(
            _PlannedFault(first.replies_left, first.until_s, first.deliveries, second.carry, first.code)
        )

    def noise(self, for_s: Seconds, gap_s: Seconds = 0.05) -> None:
        """Random bytes arrive for `for_s`, on average every `gap_s`. Modbus TCP connections get no noise."""
        time_s = self._now_s()
        end_s = time_s + for_s
        while (time_s := time_s + self._random.expovariate(1 / gap_s)) < end_s:
            for connection in self._noisy:
                connection.deliver(time_s, self._random.randbytes(self._random.randint(1, JUNK_BYTES)))

    def vanish(self, for_s: Seconds) -> None:
        """All connections are lost, and no client can connect for `for_s`, as with an unplugged adapter."""
        for connection in self._connections:
            connection.disconnect(self._now_s() + for_s)

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return the method of every fault, by the name of the fault."""
        return {name: getattr(self, name) for name in FAULTS}

    def clear(self) -> None:
        """Cancel the faults planned for replies."""
        self._planned.clear()

    def answer(self, request: Message, carry_out: Callable[[bytes], bytes], time_s: float) -> list[Delivery]:
        """Return the deliveries that answer `request` at `time_s`, altered by the present fault.

        `carry_out` turns the PDU of the request into the PDU of the reply. Under the fault `refuse` it is not called.
        """
        self.before_reply()
        fault = self._next(time_s)
        pdu = carry_out(request.pdu) if fault.code is None else request.exception_pdu(fault.code)
        deliveries = fault.deliveries(request.reply(pdu))
        self._previous_pdu = pdu
        return self._in_order(time_s, deliveries)

    def _plan(
        self,
        replies: int,
        for_s: float | None,
        alter: Alter = _reply,
        carry: Carry = _whole,
        code: int | None = None,
    ) -> None:
        replies_left, until_s = (replies, inf) if for_s is None else (inf, self._now_s() + for_s)
        self._planned.append(_PlannedFault(replies_left, until_s, alter, carry, code))

    def _next(self, time_s: float) -> _PlannedFault:
        while self._planned:
            fault = self._planned[0]
            if fault.replies_left > 0 and time_s < fault.until_s:
                fault.replies_left -= 1
                return fault
            self._planned.popleft()
        return _NO_FAULT

    def _in_order(self, time_s: float, deliveries: list[Delivery]) -> list[Delivery]:
        in_order = []
        for later_s, data in deliveries:
            self._busy_until_s = max(time_s + later_s, self._busy_until_s)
            in_order.append((self._busy_until_s, data))
        return in_order
