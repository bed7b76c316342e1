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

_OTHER_CLIENT = "Check that no other program talks on this line"
_WRONG = {
    Verdict.STALE: ("the reply may be a late one to an earlier request", _OTHER_CLIENT),
    Verdict.FOREIGN: ("the reply answers another request", _OTHER_CLIENT),
    Verdict.WRONG_SIZE: ("the reply has a wrong size", _OTHER_CLIENT),
    Verdict.MALFORMED: ("the reply is no Modbus TCP frame", "Where the port speaks RTU, write rtu+tcp://"),
    Verdict.DAMAGED: ("the reply has a wrong CRC", "Check cable, termination and baud rate"),
}
"""What is wrong, and the cure."""


def failure(outcome: Outcome, who: str) -> SmadriveError:
    """The error of a request to `who` that was not answered."""
    meaning = f"exception {outcome.code}, {EXCEPTIONS.get(outcome.code, 'unknown')}" if outcome.code else ""
    if outcome.verdict in (Verdict.REFUSED, Verdict.DEFERRED):
        return ExceptionReply(f"{who}: the device refuses: {meaning}", outcome.code)
    if outcome.verdict is Verdict.SILENT:
        return DeadlineError(
            f"{who}: {len(outcome.data) or 'no'} bytes of the reply before the deadline. Check that the device is "
            "powered, and its unit id, baud rate and parity"
        )
    wrong, cure = _WRONG[outcome.verdict]
    what = ": ".join(filter(None, (meaning, outcome.data.hex(" "))))
    return ProtocolError(f"{who}: {wrong} ({what}), discarded. {cure}")
