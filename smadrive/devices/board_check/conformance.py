"""Sends frames to a board, right and wrong ones, and compares the bytes of its replies.

The frames go through the transport directly: the Modbus client of the driver sends no wrong frames, and returns only
the payload of a reply.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf
from statistics import median

from smadrive.devices.board_check.conformance_frames import CONFORMANCE
from smadrive.devices.board_check.result import CheckKind, CheckResult, judged
from smadrive.modbus.bus import silence_s
from smadrive.modbus.framing import rtu
from smadrive.modbus.transports.transport import Transport

UNIT_ID = 1
ANSWER_S = 0.06
READ_IDENTITY = bytes.fromhex(CONFORMANCE[0].request)
IDENTITY = bytes.fromhex(CONFORMANCE[0].reply)
WATCHDOG_ADDRESS, WATCHDOG_MS = 48, 300
_ATTEMPTS, _DIALOGUE_S = 5, 0.25
_GIVE_UP_S = 0.15
"""A board that has not answered after this time in s counts as silent. It must answer within `ANSWER_S`."""


class FrameLine:
    """Sends frames through `transport`. `times_s` holds the time in s from each answered frame to its reply."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self.times_s: list[float] = []

    @property
    def latest_s(self) -> float:
        """The longest allowed time in s from a frame to its reply, with the latency of the transport."""
        return ANSWER_S + self._transport.latency_s

    def now_s(self) -> float:
        """Return the time of the line's clock."""
        return self._transport.clock.now_s()

    def answer(self, frame: bytes) -> bytes:
        """Send `frame` after a pause of the line, and return the bytes of the reply; empty if none arrive.

        The reply is complete when its CRC is right, or when no more bytes arrive within `_GIVE_UP_S`.
        """
        transport = self._transport
        clock = transport.clock
        clock.sleep_until(clock.now_s() + silence_s(transport.baudrate or 115200))
        transport.discard()
        began_s = clock.now_s()
        transport.write(frame)
        reply = transport.read(began_s + _GIVE_UP_S + transport.latency_s)
        if reply:
            self.times_s.append(clock.now_s() - began_s)
        while reply and not rtu.crc_holds(reply) and (rest := transport.read(clock.now_s() + _GIVE_UP_S)):
            reply += rest
        return reply


def conformance_results(line: FrameLine, make_ready: Callable[[], None]) -> Iterator[CheckResult]:
    """Yield the results for the conformance frames, for frames that must get no answer, and for the response time."""
    yield from _dialogue_results(line, make_ready)
    yield from _silent_results(line)
    middle_s = median(line.times_s) if line.times_s else inf
    detail = f"median {middle_s * 1e3:.1f} ms, limit {line.latest_s * 1e3:.0f} ms"
    yield judged(CheckKind.CONFORMANCE, "replies are in time", passed=middle_s <= line.latest_s, detail=detail)


def _dialogue_results(line: FrameLine, make_ready: Callable[[], None]) -> list[CheckResult]:
    """Return the results for the conformance frames.

    If this computer was so slow that the watchdog of the board may have tripped, send the frames again.
    """
    for _ in range(_ATTEMPTS):
        make_ready()
        began_s = line.now_s()
        replies = [line.answer(bytes.fromhex(frame.request)) for frame in CONFORMANCE]
        if line.now_s() - began_s < _DIALOGUE_S:
            break
    pairs = zip(CONFORMANCE, replies, strict=True)
    return [_compared(frame.meaning, bytes.fromhex(frame.reply), reply) for frame, reply in pairs]


def _silent_results(line: FrameLine) -> Iterator[CheckResult]:
    """Yield the results for frames that the board must not answer, then for two requests that it must answer."""
    spoiled = READ_IDENTITY[:-1] + bytes((READ_IDENTITY[-1] ^ 1,))
    write = b"\x06" + WATCHDOG_ADDRESS.to_bytes(2, "big") + WATCHDOG_MS.to_bytes(2, "big")
    for name, frame in (
        ("a wrong CRC gets no answer", spoiled),
        ("a request to another unit gets no answer", rtu.seal(UNIT_ID + 1, READ_IDENTITY[1:-2])),
        ("an incomplete request gets no answer", READ_IDENTITY[:5]),
        ("a broadcast gets no answer", rtu.seal(rtu.BROADCAST, write)),
    ):
        yield _compared(name, b"", line.answer(frame))
    read = rtu.seal(UNIT_ID, b"\x03" + WATCHDOG_ADDRESS.to_bytes(2, "big") + b"\x00\x01")
    right = rtu.seal(UNIT_ID, b"\x03\x02" + WATCHDOG_MS.to_bytes(2, "big"))
    yield _compared("a broadcast is carried out", right, line.answer(read))
    yield _compared("the board still answers", IDENTITY, line.answer(READ_IDENTITY))


def _compared(name: str, right: bytes, reply: bytes) -> CheckResult:
    detail = "" if reply == right else f"reply {_shown(reply)}, must be {_shown(right)}"
    return judged(CheckKind.CONFORMANCE, name, passed=reply == right, detail=detail)


def _shown(frame: bytes) -> str:
    return frame.hex(" ").upper() or "none"
