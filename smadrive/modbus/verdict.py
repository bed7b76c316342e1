"""The rules of the client as tables: the verdict on the bytes that arrived, its consequences, the connection's states.

A reply is accepted only if unit, function, byte count (or echo), length and CRC match the request. A frame that
answers an earlier request is recognised by its transaction number (Modbus TCP) or by its kind (RTU, see
outstanding.py):

    arrived                      no frame of that kind outstanding    such a frame outstanding
    the reply                    ANSWERED                             STALE
    an exception                 REFUSED, or DEFERRED by its code     STALE
    another frame                FOREIGN                              FOREIGN
    the right head, wrong size   WRONG_SIZE                           WRONG_SIZE
    a wrong CRC                  DAMAGED                              DAMAGED
    no frame of the protocol     MALFORMED                            MALFORMED
    no whole frame in time       SILENT                               SILENT

The consequences of a verdict (`CONSEQUENCES`): after ANSWERED no frame of this unit is outstanding. After a failure the
reply and an exception may still arrive. After an exception the reply may still arrive, too: a busy device or a gateway
may answer later (DEFERRED), and a second copy of an older exception looks like the present exception. So the reply
stays outstanding, and is never taken for the answer to the next request. After a final exception (REFUSED) no reply to
an older request can arrive any more.

The states of the connection (`TRANSITIONS`):

    READY         a request may be sent
    WAITING       a request was sent, its reply is awaited
    SUSPECT       bytes that answer an earlier request may arrive: silence must come first (RTU only)
    OUT_OF_STEP   the last frame in the stream is incomplete: only a new connection helps (TCP only)
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

FINAL_CODES = frozenset((1, 2, 3, 4, 7, 8))
"""Exception codes that end a request. After the other codes (5, 6, 10, 11) the real reply may follow."""


class Verdict(Enum):
    """The verdict on what arrived for a request; see the head of this file."""

    ANSWERED = auto()
    REFUSED = auto()
    DEFERRED = auto()
    STALE = auto()
    FOREIGN = auto()
    WRONG_SIZE = auto()
    DAMAGED = auto()
    MALFORMED = auto()
    SILENT = auto()


class ConnectionState(Enum):
    """The state of the connection, which decides if a request may be sent; see the head of this file."""

    READY = auto()
    WAITING = auto()
    SUSPECT = auto()
    OUT_OF_STEP = auto()


class ConnectionEvent(Enum):
    """An event that changes the state of the connection."""

    SENT = auto()
    DONE = auto()
    FAILED = auto()
    STRAY = auto()
    SILENCE = auto()
    NEW_CONNECTION = auto()


class Consequence(NamedTuple):
    """The consequence of a verdict.

    proves               no reply to an older request of this unit can follow
    reply_remains        the reply to the request may still arrive
    exception_remains    an exception to the request may still arrive
    event                the event that changes the state of the connection
    """

    proves: bool
    reply_remains: bool
    exception_remains: bool
    event: ConnectionEvent


VERDICTS = {
    (Verdict.ANSWERED, False): Verdict.ANSWERED,
    (Verdict.ANSWERED, True): Verdict.STALE,
    (Verdict.REFUSED, False): Verdict.REFUSED,
    (Verdict.REFUSED, True): Verdict.STALE,
    (Verdict.DEFERRED, False): Verdict.DEFERRED,
    (Verdict.DEFERRED, True): Verdict.STALE,
}
"""The verdict on an intact reply or exception. The key: what arrived, and True if such a frame is outstanding."""

_FAILED = Consequence(proves=False, reply_remains=True, exception_remains=True, event=ConnectionEvent.FAILED)
CONSEQUENCES = {
    Verdict.ANSWERED: Consequence(
        proves=True, reply_remains=False, exception_remains=False, event=ConnectionEvent.DONE
    ),
    Verdict.REFUSED: Consequence(proves=True, reply_remains=True, exception_remains=False, event=ConnectionEvent.DONE),
    Verdict.DEFERRED: Consequence(
        proves=False, reply_remains=True, exception_remains=False, event=ConnectionEvent.DONE
    ),
    Verdict.STALE: _FAILED,
    Verdict.FOREIGN: _FAILED,
    Verdict.WRONG_SIZE: _FAILED,
    Verdict.DAMAGED: _FAILED,
    Verdict.MALFORMED: _FAILED,
    Verdict.SILENT: _FAILED,
}

TRANSITIONS = {
    (ConnectionState.READY, ConnectionEvent.SENT): ConnectionState.WAITING,
    (ConnectionState.WAITING, ConnectionEvent.DONE): ConnectionState.READY,
    (ConnectionState.WAITING, ConnectionEvent.FAILED): ConnectionState.SUSPECT,
    (ConnectionState.READY, ConnectionEvent.FAILED): ConnectionState.SUSPECT,
    (ConnectionState.READY, ConnectionEvent.STRAY): ConnectionState.SUSPECT,
    (ConnectionState.SUSPECT, ConnectionEvent.STRAY): ConnectionState.SUSPECT,
    (ConnectionState.SUSPECT, ConnectionEvent.FAILED): ConnectionState.SUSPECT,
    (ConnectionState.SUSPECT, ConnectionEvent.SILENCE): ConnectionState.READY,
    (ConnectionState.READY, ConnectionEvent.SILENCE): ConnectionState.READY,
    **{(state, ConnectionEvent.NEW_CONNECTION): ConnectionState.SUSPECT for state in ConnectionState},
}
"""The next state on RTU, by state and event. On Modbus TCP, READY and SUSPECT both become OUT_OF_STEP after an
incomplete frame, and READY otherwise."""


class Outcome(NamedTuple):
    """The outcome of a request.

    verdict    the verdict on the bytes that arrived
    data       the payload of the right reply (ANSWERED), otherwise the bytes that arrived
    code       the code of an exception; 0 for every other frame
    """

    verdict: Verdict
    data: bytes = b""
    code: int = 0
