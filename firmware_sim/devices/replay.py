"""Recorded bus traffic, served as devices: every unit of the trace replies as in the recording, with the same delay.

If a request was recorded several times, the unit sends the recorded replies in their order. It then repeats the last
recorded reply. A request without a recorded reply gets no reply. A corrupt reply is sent as it was recorded. A request
that is not in the recording gets no reply, and an event line names this request.

Two exchanges (FC23) count as the same request even if they write different words, because a driver begins its sequence
numbers at a random number. If the recorded reply repeats a word that the recorded request wrote, the sent reply repeats
the word that the present request writes at this position.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from firmware_sim.bus.faults import Delivery
from firmware_sim.bus.message import ModbusMessage
from firmware_sim.bus.ports import Port, RtuPort, TcpPort
from smadrive.clock import Clock
from smadrive.errors import ConfigError
from smadrive.modbus import pdu_description
from smadrive.modbus.framing import rtu
from smadrive.modbus.trace import TraceLine, content_of, read_trace
from smadrive.modbus.transports.in_process import InProcessTransport

EXCHANGE = b"\x17"
WRITTEN_WORDS = 10
"""Offset of the written words in the PDU of an exchange."""
MAX_DELAY_S = 3600.0
"""The longest allowed delay of a recorded reply, s. No driver waits longer."""


class RecordedReply(NamedTuple):
    """A reply and its delay after the request.

    `data` is the recorded frame, empty if no reply was recorded. `pdu` is None for a corrupt frame. `echoes` has a pair
    for every word of the request that the reply repeats: its offset in the reply, and its offset in the request.
    """

    after_s: float
    data: bytes
    pdu: bytes | None
    echoes: tuple[tuple[int, int], ...] = ()

    def pdu_for(self, request: bytes) -> bytes:
        """Return the PDU of the reply. The words that the reply repeats are taken from `request`."""
        reply = bytearray(self.pdu or b"")
        for in_reply, in_request in self.echoes:
            reply[in_reply : in_reply + 2] = request[in_request : in_request + 2]
        return bytes(reply)


RepliesByRequest = dict[bytes, deque[RecordedReply]]  # by the identifying part of the request, see _key


class Replay:
    """The devices of the trace at `path`. `log` gets a line per event, with the time."""

    def __init__(self, path: Path, log: Callable[[str], None] = lambda _line: None) -> None:
        """Read the trace. ConfigError for a file that is not a trace, and for impossible times."""
        self.numbered, lines = read_trace(path)
        self.time_s = 0.0
        self._log = log
        replies = _recorded_replies(path, lines, numbered=self.numbered)
        self.units = tuple(
            ReplayedUnit(unit_id, by_request, self._log_unknown) for unit_id, by_request in sorted(replies.items())
        )
        self.port = self.new_port(numbered=self.numbered)

    def advance_to(self, time_s: float) -> None:
        """Move the time to `time_s`. Do nothing for a time in the past."""
        self.time_s = max(self.time_s, time_s)

    def new_port(self, *, numbered: bool) -> Port:
        """Return a new port to the same units, for Modbus TCP frames if `numbered`, otherwise for RTU frames."""
        return TcpPort(self.units) if numbered else RtuPort(self.units)

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        self.advance_to(time_s)
        return self.port.receive(data, time_s)

    def transport(self, clock: Clock) -> InProcessTransport:
        """Return a connection to the recorded devices, in this process. It takes the time from `clock`."""
        return InProcessTransport(self, clock, None if self.numbered else 115200)

    def _log_unknown(self, request: ModbusMessage) -> None:
        description = pdu_description.of_request(request.pdu)
        self._log(f"t={self.time_s:.3f} s not in the recording: unit {request.unit_id}, {description}")


class ReplayedUnit:
    """One unit of a recorded bus."""

    def __init__(self, unit_id: int, replies: RepliesByRequest, log_unknown: Callable[[ModbusMessage], None]) -> None:
        """`log_unknown` gets every request that is not in the recording."""
        self.unit_id = unit_id
        self._replies = replies
        self._log_unknown = log_unknown

    def answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        """Return the next recorded reply to this request, with its recorded delay."""
        replies = self._replies.get(_key(request.pdu))
        if not replies:
            self._log_unknown(request)
            return []
        reply = replies.popleft() if len(replies) > 1 else replies[0]
        data = reply.data if reply.pdu is None else request.reply(reply.pdu_for(request.pdu)).frame
        return [(time_s + reply.after_s, data)] if data else []


def _recorded_replies(path: Path, lines: Sequence[TraceLine], *, numbered: bool) -> dict[int, RepliesByRequest]:
    """Return the replies of every unit to every request, in their order. ConfigError for an impossible delay."""
    replies: dict[int, RepliesByRequest] = defaultdict(lambda: defaultdict(deque))
    traffic = [line for line in lines if line.direction != "discarded"]
    for line, following in zip(traffic, [*traffic[1:], None], strict=True):
        request = content_of(line.data, numbered=numbered) if line.direction == "sent" else None
        if request is not None and request[0] != rtu.BROADCAST:
            unit_id, pdu = request
            reply = _recorded_reply(line, following, numbered=numbered)
            if not 0.0 <= reply.after_s <= MAX_DELAY_S:
                raise ConfigError(
                    f"impossible delay of the reply to the request at {line.time_s:g} s",
                    where=path,
                    value=f"{reply.after_s:g} s",
                    limit=f"0 to {MAX_DELAY_S:g} s",
                    cure="correct the times, or remove the exchange",
                )
            replies[unit_id][_key(pdu)].append(reply)
    return replies


def _recorded_reply(request: TraceLine, following: TraceLine | None, *, numbered: bool) -> RecordedReply:
    if following is None or following.direction != "received":
        return RecordedReply(0.0, b"", None)
    after_s = following.time_s - request.time_s
    received = content_of(following.data, numbered=numbered)
    sent = content_of(request.data, numbered=numbered)
    if received is None or sent is None or received[0] != sent[0]:
        return RecordedReply(after_s, following.data, None)
    return RecordedReply(after_s, following.data, received[1], _echoes(sent[1], received[1]))


def _key(pdu: bytes) -> bytes:
    """Return the part of a PDU that identifies the request: all of it, or of an exchange all but the written words."""
    return pdu[:WRITTEN_WORDS] if pdu[:1] == EXCHANGE else pdu


def _echoes(request: bytes, reply: bytes) -> tuple[tuple[int, int], ...]:
    """Return the offsets of the words that an exchange writes and its reply repeats, as pairs (in reply, in request).

    Words with the value 0 are left out. The result is empty for another function.
    """
    if request[:1] != EXCHANGE or reply[:1] != EXCHANGE:
        return ()
    words = [reply[offset : offset + 2] for offset in range(2, len(reply), 2)]
    written = ((offset, request[offset : offset + 2]) for offset in range(WRITTEN_WORDS, len(request), 2))
    return tuple((2 + 2 * words.index(word), offset) for offset, word in written if word in words and any(word))
