"""Replies that may still arrive although the client no longer waits for them.

After a request without an answer, the reply may still arrive, or an exception. A Modbus RTU frame has no transaction
number. So only the kind of such a frame distinguishes it from the answer to a later request:

    kind of a reply       unit, head (function and byte count, or the echo of a write), payload size
    kind of an exception  unit, function with the top bit set

An outstanding frame is forgotten after `LATEST_REPLY_S`, or when its unit has answered a later request: a device
answers in order, so no older reply can follow that answer.
"""

from __future__ import annotations

from smadrive.modbus.requests import Request

LATEST_REPLY_S = 10.0
"""After this time in seconds, a frame no longer counts as outstanding. Every latency that a URL may set is shorter."""

Kind = tuple[int, bytes, int]


def reply_kind(unit_id: int, request: Request) -> Kind:
    """Return the kind of the right reply of `unit_id` to `request`."""
    return unit_id, request.reply_head, request.payload_size


def exception_kind(unit_id: int, request: Request) -> Kind:
    """Return the kind of an exception of `unit_id` to `request`; all requests of one function share this kind."""
    return unit_id, bytes((request.function | 0x80,)), 1


class Outstanding:
    """The kinds of frames that may still arrive, each with the last moment at which such a frame may arrive."""

    def __init__(self) -> None:
        self._until_s: dict[Kind, float] = {}

    def __bool__(self) -> bool:
        """Return True if at least one kind of frame is recorded, even if its time has passed."""
        return bool(self._until_s)

    def add(self, kind: Kind, now_s: float) -> None:
        """Record that a frame of this kind may arrive until `LATEST_REPLY_S` after `now_s`."""
        self._until_s[kind] = now_s + LATEST_REPLY_S

    def holds(self, kind: Kind, now_s: float) -> bool:
        """Return True if a frame of this kind may still arrive at `now_s`."""
        until_s = self._until_s.get(kind)
        if until_s is None:
            return False
        if until_s > now_s:
            return True
        del self._until_s[kind]
        return False

    def clear(self, unit_id: int) -> None:
        """Forget every frame of `unit_id`, which has answered a later request."""
        self._until_s = {kind: until_s for kind, until_s in self._until_s.items() if kind[0] != unit_id}
