"""What arrived for a request, and what that leaves behind: the rules of the client as tables.

A reply counts only if unit, function, byte count (or echo), length and CRC are those of the request. Frames that belong
to an earlier request are told by their transaction number (Modbus TCP) or by their kind (RTU, see outstanding.py):

    arrived                      nothing of that kind outstanding     such a frame outstanding
    the reply                    ANSWERED                             STALE
    an exception                 REFUSED, or DEFERRED by its code     STALE
    another frame                FOREIGN                              FOREIGN
    the right head, wrong size   WRONG_SIZE                           WRONG_SIZE
    a wrong CRC                  DAMAGED                              DAMAGED
    no frame of the protocol     MALFORMED                            MALFORMED
    nothing, or half a frame     SILENT                               SILENT

What a verdict leaves behind (`CONSEQUENCES`): only ANSWERED ends the matter. After a failure both the reply and an
exception may still arrive. Behind an exception the real reply may come: a busy device or a gateway answers later after
all (DEFERRED), and a second copy of an older exception looks like this one. So the reply stays outstanding, and a lag
by one reply cannot begin. A final exception of the device proves that it is past its older requests.

The states of the connection (`TRANSITIONS`):

    READY         a request may go out
    WAITING       a request is out
    SUSPECT       bytes may be on their way that nobody waits for: silence must come first (RTU only)
    OUT_OF_STEP   a frame was left unfinished in a stream: only a new connection helps (TCP only)
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

FINAL_CODES = frozenset((1, 2, 3, 4, 7, 8))
"""Exception codes by which a device ends a request; 5, 6, 10 and 11 may be followed by the real reply."""


class Verdict(Enum):
    """What arrived for a request."""

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
    """Whether a request may go out."""

    READY = auto()
    WAITING = auto()
    SUSPECT = auto()
    OUT_OF_STEP = auto()


class ConnectionEvent(Enum):
    """What changes the state."""

    SENT = auto()
    DONE = auto()
    FAILED = auto()
    STRAY = auto()
    SILENCE = auto()
    NEW_CONNECTION = auto()


class Consequence(NamedTuple):
    """`proves`: the unit is past its older requests. What may still arrive of this one. `event`: of the state."""

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
"""By what arrived, and whether such a frame is outstanding; every other arrival is its own verdict."""

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
"""Of RTU; in a numbered stream SUSPECT is READY, or OUT_OF_STEP where a frame was left unfinished."""


class Outcome(NamedTuple):
    """A verdict; the payload of a reply, the code of an exception, or the bytes that prove the reply wrong."""

    verdict: Verdict
    data: bytes = b""
    code: int = 0
