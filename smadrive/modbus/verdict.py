"""The rules of the client as tables: the verdict on what arrived, its consequences, the states of the connection.

A reply counts only if unit, function, byte count (or echo), length and CRC are those of the request. A frame of an
earlier request is recognised by its transaction number (Modbus TCP) or by its kind (RTU, see outstanding.py):

    arrived                      nothing of that kind outstanding     such a frame outstanding
    the reply                    ANSWERED                             STALE
    an exception                 REFUSED, or DEFERRED by its code     STALE
    another frame                FOREIGN                              FOREIGN
    the right head, wrong size   WRONG_SIZE                           WRONG_SIZE
    a wrong CRC                  DAMAGED                              DAMAGED
    no frame of the protocol     MALFORMED                            MALFORMED
    nothing, or half a frame     SILENT                               SILENT

The consequences of a verdict (`CONSEQUENCES`): only after ANSWERED nothing is outstanding. After a failure both the
reply and an exception may still arrive. After an exception the real reply may come: a busy device or a gateway may
answer later (DEFERRED), and a second copy of an older exception looks like this one. So the reply stays outstanding,
and a lag by one reply cannot begin. A final exception of the device proves that it is past its older requests.

The states of the connection (`TRANSITIONS`):

    READY         a request may go out
    WAITING       a request is out
    SUSPECT       bytes of an earlier request may be on their way: silence must come first (RTU only)
    OUT_OF_STEP   a frame was left unfinished in a stream: only a new connection helps (TCP only)
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

FINAL_CODES = frozenset((1, 2, 3, 4, 7, 8))
"""Exception codes by which a device ends a request; 5, 6, 10 and 11 may be followed by the real reply."""


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
    """The state of the connection: whether a request may go out."""

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
    """`proves`: the unit is past its older requests. `..._remains`: it may still arrive. `event` changes the state."""

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
"""The verdict by what arrived and whether such a frame is outstanding; every other arrival is its own verdict."""

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
"""The next state on RTU. In a numbered stream SUSPECT is READY, or OUT_OF_STEP where a frame was left unfinished."""


class Outcome(NamedTuple):
    """A verdict, with the payload of a reply, the code of an exception, or the bytes of a wrong reply."""

    verdict: Verdict
    data: bytes = b""
    code: int = 0
