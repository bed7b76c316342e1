"""The choice of reads whose answers prove that older replies cannot arrive any more.

A frame is outstanding if it may still arrive although the client no longer waits for it. Only the kind of a frame (see
outstanding.py) distinguishes it from other frames.

A probe is a read whose reply differs in kind from every outstanding frame. The answer to a probe proves that no reply
to an older request of this unit can arrive any more.

A sync is a read whose reply differs in kind from all frames that have arrived lately. So the answer to a sync cannot be
a copy of an older reply. The unit answers in order, so no older reply can arrive after the answer to a sync. The next
reply therefore belongs to the next request.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from math import inf

from smadrive.modbus import requests
from smadrive.modbus.outstanding import LATEST_REPLY_S, Kind, Outstanding, exception_kind, reply_kind
from smadrive.modbus.requests import Request

FRESH = 16
"""A kind has not arrived lately if none of the last `FRESH` frames was of this kind: a gateway may lag that much."""
NEVER = -FRESH - 1


class Probes:
    """Chooses the probes and syncs of one connection (see the head of this file).

    It uses the frames that have arrived, and the `outstanding` frames, which may still arrive.
    """

    def __init__(self, outstanding: Outstanding) -> None:
        self._outstanding = outstanding
        self._answered: dict[Kind, Request] = {}
        self._arrivals = 0
        self._arrived: dict[Kind, int] = {}
        self._arrived_s: dict[Kind, float] = {}
        self._silent: set[Kind] = set()

    def note_frame(self) -> None:
        """Count one more finished request, even if no frame has arrived for it."""
        self._arrivals += 1

    def note_reply(self, unit_id: int, request: Request, now_s: float) -> None:
        """Record that the frame of the request counted last is the right reply to `request`."""
        kind = reply_kind(unit_id, request)
        self._arrived[kind], self._arrived_s[kind] = self._arrivals, now_s
        if not request.writes:
            self._answered[kind] = request

    def note_exception(self, unit_id: int, request: Request) -> None:
        """Record that the frame of the request counted last is an exception to `request`."""
        self._arrived[exception_kind(unit_id, request)] = self._arrivals

    def has_answered(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Return True if a read that the unit has answered, or the same read of fewer addresses, can be the probe."""
        return next(self._clean(unit_id, request, self._answered_reads(unit_id), now_s), None) is not None

    def probe_request(self, unit_id: int, request: Request, attempt: int, now_s: float) -> Request | None:
        """Return the probe number `attempt` (from 0) for `request`: the first suitable read of this list.

        1. reads that the unit has answered, and the same reads of fewer addresses
        2. reads with other functions, but only from `attempt` 1 on
        3. reads of other lengths

        Return None when the reply to each of them has the kind of an outstanding frame or of the reply to `request`.
        """
        others = () if attempt == 0 else _other_functions(request)
        tries = chain(self._answered_reads(unit_id), others, _other_lengths(request))
        return next(self._clean(unit_id, request, tries, now_s), None)

    def sync_request(self, unit_id: int, request: Request, now_s: float) -> Request:
        """Return a sync for `request`.

        The first choice is a read that the unit has answered, if the last `FRESH` frames hold no answer of this kind.
        Otherwise the choice includes reads of other lengths and functions, except those that got no answer before. Of
        these, return the read whose kind of answer never arrived, or arrived longest ago. If no read has another kind
        than the reply to `request`, return `request`.
        """
        answered = list(self._clean(unit_id, request, self._answered_reads(unit_id), now_s))
        sure = min(answered, key=lambda one: self._last_arrival(unit_id, one), default=None)
        if sure is not None and self._arrivals - self._last_arrival(unit_id, sure) > FRESH:
            return sure
        others = chain(islice(_other_lengths(request), FRESH), _other_functions(request))
        tries = [one for one in self._clean(unit_id, request, others, now_s) if self._may_answer(unit_id, one)]
        return min([*answered, *tries], key=lambda one: self._last_arrival(unit_id, one), default=request)

    def answered_sync_request(self, unit_id: int, request: Request, now_s: float) -> Request | None:
        """Return a sync for `request`: a read that the unit has answered, or the same read of fewer addresses.

        A unit may ignore other reads. Of these reads, return the one whose kind of answer never arrived, or arrived
        longest ago. Return None if the reply to each of them has the kind of an outstanding frame or of the reply to
        `request`.
        """
        answered = self._clean(unit_id, request, self._answered_reads(unit_id), now_s)
        return min(answered, key=lambda one: self._last_arrival(unit_id, one), default=None)

    def stays_silent(self, unit_id: int, request: Request) -> bool:
        """Record that the unit did not answer the sync `request`.

        Return True if the unit has never answered a read with the function and the address of this sync.
        """
        self._silent.add(reply_kind(unit_id, request))
        return not any(request.pdu[:3] == one.pdu[:3] for kind, one in self._answered.items() if kind[0] == unit_id)

    def copy_may_follow(self, unit_id: int, request: Request, now_s: float) -> bool:
        """Return True if the last reply to `request` is so recent that a second copy of it may still arrive."""
        return now_s < self._arrived_s.get(reply_kind(unit_id, request), -inf) + LATEST_REPLY_S

    def _last_arrival(self, unit_id: int, one: Request) -> int:
        """Return the count of finished requests at the last reply or exception to the read `one`; else `NEVER`."""
        kinds = reply_kind(unit_id, one), exception_kind(unit_id, one)
        return max(self._arrived.get(kind, NEVER) for kind in kinds)

    def _may_answer(self, unit_id: int, one: Request) -> bool:
        return reply_kind(unit_id, one) not in self._silent

    def _clean(self, unit_id: int, request: Request, tries: Iterable[Request], now_s: float) -> Iterator[Request]:
        """Return the `tries` whose replies differ in kind from each outstanding frame and the reply to `request`."""
        own = reply_kind(unit_id, request)
        kinds = ((one, reply_kind(unit_id, one)) for one in tries)
        return (one for one, kind in kinds if kind != own and not self._outstanding.holds(kind, now_s))

    def _answered_reads(self, unit_id: int) -> Iterator[Request]:
        """Yield the reads that this unit has answered, then the same reads with fewer addresses."""
        answered = [request for kind, request in self._answered.items() if kind[0] == unit_id]
        yield from answered
        for request in answered:
            for count in range(1, requests.read_count(request)):
                yield requests.read_like(request, count)


def _other_lengths(request: Request) -> Iterator[Request]:
    """Yield reads of 1 to 125 addresses from the address of `request`; FC03 if it writes, otherwise its function."""
    for count in range(1, requests.MAX_READ_REGISTERS + 1):
        yield requests.read_like(request, count)


def _other_functions(request: Request) -> Iterator[Request]:
    """Yield a read of one address with each reading function (FC01 to FC04) except the function of `request`.

    A device that does not support a function answers with an exception. It proves as much as a reply.
    """
    address = requests.read_like(request, 1).address
    reads = (requests.read_holding, requests.read_input, requests.read_discrete, requests.read_coils)
    for read in reads:
        other = read(address, 1)
        if other.function != request.function:
            yield other
