"""A recorded bus served as devices: every unit of the trace answers as it did then, after the same time.

A request is answered by what came to the same request in the recording: the first time by the first answer, and so on;
when the recording has no more of them, by the last. What was not answered then is not answered now, and a spoilt reply
comes spoilt. A request that the recording does not know is met with silence, and told as an event.

An exchange (FC23) is the same request whatever it writes: a driver begins its sequence at random. Where the recorded
reply repeats a word that was written, the word that is written now is repeated.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
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
WRITTEN = 10
"""Where in the PDU of an exchange the written words begin."""
LONGEST_S = 3600.0
"""No driver waits longer for a reply."""


class Answer(NamedTuple):
    """What came, and how long after the request: nothing (`data` is empty), or a frame; `pdu` is None if not intact.

    `echoes`: where the reply repeats a written word, and where that word stands in the request.
    """

    after_s: float
    data: bytes
    pdu: bytes | None
    echoes: tuple[tuple[int, int], ...] = ()

    def pdu_for(self, request: bytes) -> bytes:
        """What the reply says to `request`."""
        reply = bytearray(self.pdu or b"")
        for there, here in self.echoes:
            reply[there : there + 2] = request[here : here + 2]
        return bytes(reply)


class Replay:
    """The devices of the trace at `path`. `tell` gets a line per event, with the time."""

    def __init__(self, path: Path, tell: Callable[[str], None] = lambda _line: None) -> None:
        """ConfigError when `path` is no trace."""
        numbered, lines = read_trace(path)
        self.time_s = 0.0
        self.numbered = numbered
        self._tell = tell
        answers: dict[int, dict[bytes, deque[Answer]]] = defaultdict(lambda: defaultdict(deque))
        traffic = [line for line in lines if line.direction != "discarded"]
        for line, after in zip(traffic, [*traffic[1:], None], strict=True):
            request = content_of(line.data, numbered=numbered) if line.direction == "sent" else None
            if request is not None and request[0] != rtu.BROADCAST:
                unit_id, pdu = request
                answer = _answer(line, after, numbered=numbered)
                if not 0.0 <= answer.after_s <= LONGEST_S:
                    raise ConfigError(
                        f"{path}: a reply comes {answer.after_s:g} s after its request at {line.time_s:g} s, "
                        f"allowed are 0 to {LONGEST_S:g} s: correct the times, or remove the exchange"
                    )
                answers[unit_id][_key(pdu)].append(answer)
        self.units = tuple(ReplayedUnit(unit_id, known, self._unknown) for unit_id, known in sorted(answers.items()))
        self.port = self.new_port(numbered=numbered)

    def advance_to(self, time_s: float) -> None:
        """Let the time reach `time_s`."""
        self.time_s = max(self.time_s, time_s)

    def new_port(self, *, numbered: bool) -> Port:
        """A way in."""
        return TcpPort(self.units) if numbered else RtuPort(self.units)

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Bytes that arrive at `time_s`: what is answered, and when it arrives."""
        self.advance_to(time_s)
        return self.port.receive(data, time_s)

    def transport(self, clock: Clock) -> InProcessTransport:
        """A connection in this process, in time with `clock`."""
        return InProcessTransport(self, clock, None if self.numbered else 115200)

    def _unknown(self, request: ModbusMessage) -> None:
        said = pdu_description.of_request(request.pdu)
        self._tell(f"t={self.time_s:.3f} s not in the recording: unit {request.unit_id}, {said}")


class ReplayedUnit:
    """One unit of a recorded bus."""

    def __init__(
        self, unit_id: int, known: dict[bytes, deque[Answer]], tell_unknown: Callable[[ModbusMessage], None]
    ) -> None:
        self.unit_id = unit_id
        self._known = known
        self._tell_unknown = tell_unknown

    def answer(self, request: ModbusMessage, time_s: float) -> list[Delivery]:
        """What came then, as long after."""
        answers = self._known.get(_key(request.pdu))
        if not answers:
            self._tell_unknown(request)
            return []
        answer = answers.popleft() if len(answers) > 1 else answers[0]
        data = answer.data if answer.pdu is None else request.answered(answer.pdu_for(request.pdu)).frame
        return [(time_s + answer.after_s, data)] if data else []


def _answer(request: TraceLine, after: TraceLine | None, *, numbered: bool) -> Answer:
    if after is None or after.direction != "received":
        return Answer(0.0, b"", None)
    content = content_of(after.data, numbered=numbered)
    asked = content_of(request.data, numbered=numbered)
    if content is None or asked is None or content[0] != asked[0]:
        return Answer(after.time_s - request.time_s, after.data, None)
    return Answer(after.time_s - request.time_s, after.data, content[1], _echoes(asked[1], content[1]))


def _key(pdu: bytes) -> bytes:
    """What makes two requests the same: all of it, or all but the words that an exchange writes."""
    return pdu[:WRITTEN] if pdu[:1] == EXCHANGE else pdu


def _echoes(request: bytes, reply: bytes) -> tuple[tuple[int, int], ...]:
    """The first place of each written word among the words of the reply to an exchange; zeros are no echo."""
    if request[:1] != EXCHANGE or reply[:1] != EXCHANGE:
        return ()
    words = [reply[there : there + 2] for there in range(2, len(reply), 2)]
    written = ((here, request[here : here + 2]) for here in range(WRITTEN, len(request), 2))
    return tuple((2 + 2 * words.index(word), here) for here, word in written if word in words and any(word))
