"""From a verdict to the error that is raised, and to the counters that it moves."""

from __future__ import annotations

from smadrive.errors import DeadlineError, ExceptionReply, ProtocolError, SmadriveError
from smadrive.modbus.bus import EXCEPTIONS
from smadrive.modbus.verdict import Outcome, Verdict

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
"""The BusCounters that a failure moves."""

_OTHER_CLIENT = "check that no other program talks on this line"
_WRONG = {
    Verdict.STALE: ("discarded, the reply may be a late one to an earlier request", _OTHER_CLIENT),
    Verdict.FOREIGN: ("discarded, the reply answers another request", _OTHER_CLIENT),
    Verdict.WRONG_SIZE: ("discarded, the reply has a wrong size", _OTHER_CLIENT),
    Verdict.MALFORMED: ("discarded, the reply is no Modbus TCP frame", "where the port speaks RTU, write rtu+tcp://"),
    Verdict.DAMAGED: ("discarded, the reply has a wrong CRC", "check cable, termination and baud rate"),
}
"""What is wrong, and the cure."""


def failure(outcome: Outcome, where: str) -> SmadriveError:
    """The error of a request to `where` that was not answered."""
    meaning = f"exception {outcome.code}, {EXCEPTIONS.get(outcome.code, 'unknown')}" if outcome.code else ""
    if outcome.verdict in (Verdict.REFUSED, Verdict.DEFERRED):
        return ExceptionReply("the device refuses", outcome.code, where=where, value=meaning)
    if outcome.verdict is Verdict.SILENT:
        return DeadlineError(
            "the reply was not complete before the deadline" if outcome.data else "no reply before the deadline",
            where=where,
            value=f"{len(outcome.data)} bytes",
            cure="check that the device is powered, and its unit id, baud rate and parity",
        )
    wrong, cure = _WRONG[outcome.verdict]
    value = ": ".join(filter(None, (meaning, outcome.data.hex(" "))))
    return ProtocolError(wrong, where=where, value=value, cure=cure)
