"""The error that is raised for a verdict, and the counters that the verdict increments."""

from __future__ import annotations

from smadrive.display.number_text import count_text
from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, SmadriveError
from smadrive.modbus.verdict import MEANINGS, TRANSIENT_CODES, Outcome, Verdict

COUNTED = {
    Verdict.REFUSED: ("replies", "exceptions"),
    Verdict.DEFERRED: ("replies", "exceptions"),
    Verdict.SILENT: ("timeouts",),
    Verdict.STALE: ("stale_replies",),
    Verdict.FOREIGN: ("wrong_replies",),
    Verdict.WRONG_SIZE: ("wrong_replies",),
    Verdict.MALFORMED: ("wrong_replies",),
    Verdict.DAMAGED: ("crc_errors",),
}
"""The fields of BusCounters that a failure increments, by its verdict."""

_OTHER_CLIENT = "check that no other program uses this line"
_WRONG = {
    Verdict.STALE: ("discarded, because the reply may answer an earlier request", _OTHER_CLIENT),
    Verdict.FOREIGN: ("discarded, because the reply answers another request", _OTHER_CLIENT),
    Verdict.WRONG_SIZE: ("discarded, because the reply has a wrong size", _OTHER_CLIENT),
    Verdict.MALFORMED: (
        "discarded, because the reply is no Modbus TCP frame",
        "if the port speaks Modbus RTU, write rtu+tcp:// in the URL",
    ),
    Verdict.DAMAGED: (
        "discarded, because the reply has a wrong CRC",
        "check the cable, its termination and the baud rate",
    ),
}
"""The message and the cure of the error, by the verdict on a wrong reply."""


def failure(outcome: Outcome, where: str) -> SmadriveError:
    """Return the error for a request whose outcome is not ANSWERED; `where` names bus, unit and request."""
    meaning = f"exception {outcome.code}, {MEANINGS.get(outcome.code, 'unknown')}" if outcome.code else ""
    if outcome.verdict in (Verdict.REFUSED, Verdict.DEFERRED):
        is_transient = outcome.code in TRANSIENT_CODES
        return ExceptionReply("the device rejects the request", outcome.code, is_transient, where=where, value=meaning)
    if outcome.verdict is Verdict.SILENT:
        return DeadlineError(
            "the reply was incomplete at the deadline" if outcome.data else "no reply before the deadline",
            where=where,
            value=count_text(len(outcome.data), "byte"),
            cure="check that the device is powered, and that unit id, baud rate and parity are right",
        )
    wrong, cure = _WRONG[outcome.verdict]
    value = ": ".join(filter(None, (meaning, outcome.data.hex(" "))))
    return ProtocolError(wrong, where=where, value=value, cure=cure)
