"""The rules of the client as tables: the verdict on the bytes that arrived, its consequences, the connection's states.

A reply is accepted only if unit, function, byte count (or echo), length and CRC match the request. A reply may answer
an earlier request if a frame of its kind (see outstanding.py) is outstanding. On RTU, the same holds for an exception.
On Modbus TCP, framing.py has already dropped the frames with the transaction number of another request.

    what arrived                 no frame of its kind outstanding     a frame of its kind outstanding
    the reply                    ANSWERED                             STALE
    an exception                 REFUSED or DEFERRED, by its code     STALE
    another frame                FOREIGN                              FOREIGN
    the right head, wrong size   WRONG_SIZE                           WRONG_SIZE
    a wrong CRC                  DAMAGED                              DAMAGED
    no Modbus TCP frame          MALFORMED                            MALFORMED
    no complete frame in time    SILENT                               SILENT

The consequences of a verdict (`CONSEQUENCES`) are the frames of this unit that are outstanding afterwards:

    ANSWERED     none
    REFUSED      the reply
    DEFERRED     the reply, and all frames that were outstanding before
    all others   the reply, an exception, and all frames that were outstanding before

After an exception the reply may still arrive: a busy device or a gateway may answer later (DEFERRED), and a second copy
of an older exception looks like the present exception (REFUSED). Because the reply is outstanding, it is never taken
for the answer to the next request.

The states of the connection (`TRANSITIONS`):

    READY         a request may be sent
    WAITING       a request was sent, and its reply is awaited
    SUSPECT       bytes that answer an earlier request may arrive: before a request, the bus must be silent (RTU only)
    OUT_OF_STEP   the last frame in the stream is incomplete: only a new connection helps (TCP only)
"""

from __future__ import annotations

from enum import Enum, IntEnum, auto
from typing import NamedTuple


class ExceptionCode(IntEnum):
    """The exception codes of the Modbus standard. A device may send other codes, too."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    ACKNOWLEDGE = 5
    BUSY = 6
    NEGATIVE_ACKNOWLEDGE = 7
    PARITY_ERROR = 8
    NO_PATH = 10
    NO_RESPONSE = 11


MEANINGS: dict[int, str] = {
    ExceptionCode.ILLEGAL_FUNCTION: "illegal function",
    ExceptionCode.ILLEGAL_ADDRESS: "illegal data address",
    ExceptionCode.ILLEGAL_VALUE: "illegal data value",
    ExceptionCode.DEVICE_FAILURE: "device failure",
    ExceptionCode.ACKNOWLEDGE: "acknowledged, in progress",
    ExceptionCode.BUSY: "device busy",
    ExceptionCode.NEGATIVE_ACKNOWLEDGE: "negative acknowledge",
    ExceptionCode.PARITY_ERROR: "memory parity error",
    ExceptionCode.NO_PATH: "gateway path unavailable",
    ExceptionCode.NO_RESPONSE: "gateway target did not respond",
}
"""The meaning of each exception code in messages."""

TRANSIENT_CODES = frozenset(
    (ExceptionCode.ACKNOWLEDGE, ExceptionCode.BUSY, ExceptionCode.NO_PATH, ExceptionCode.NO_RESPONSE)
)
"""Codes of a busy device or gateway: it may carry out the next request."""

FINAL_CODES = frozenset(MEANINGS) - TRANSIENT_CODES
"""Codes that end a request. After any other code, the real reply may follow."""


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

    proves               True if no reply to an older request of this unit can follow
    reply_remains        True if the reply to the request may still arrive
    exception_remains    True if an exception to the request may still arrive
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
"""The verdict on an intact reply or exception. Key: what arrived, and True if a frame of its kind is outstanding."""

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
    (ConnectionState.OUT_OF_STEP, ConnectionEvent.STRAY): ConnectionState.OUT_OF_STEP,
    (ConnectionState.SUSPECT, ConnectionEvent.FAILED): ConnectionState.SUSPECT,
    (ConnectionState.OUT_OF_STEP, ConnectionEvent.FAILED): ConnectionState.OUT_OF_STEP,
    (ConnectionState.SUSPECT, ConnectionEvent.SILENCE): ConnectionState.READY,
    (ConnectionState.READY, ConnectionEvent.SILENCE): ConnectionState.READY,
    **{(state, ConnectionEvent.NEW_CONNECTION): ConnectionState.SUSPECT for state in ConnectionState},
}
"""The next state on RTU, by state and event. On Modbus TCP, OUT_OF_STEP replaces a next state READY or SUSPECT if the
last frame is incomplete; otherwise READY replaces SUSPECT."""


class Outcome(NamedTuple):
    """The outcome of a request.

    verdict    the verdict on the bytes that arrived
    data       the payload of the right reply (ANSWERED), otherwise the bytes that arrived
    code       the code of an exception; 0 for every other frame
    """

    verdict: Verdict
    data: bytes = b""
    code: int = 0
