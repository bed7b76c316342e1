"""Survey of an RTU line: it finds the units that may be there, without a wait for each silent unit.

A request to a silent unit takes the whole response timeout, and a scan asks many units with several line settings. So
the survey sends all requests with short pauses. It waits only once, after the last request, for the response time of
the slowest device. A slow reply may therefore collide with the request to a later unit, and arrive damaged. So even a
single damaged byte shows that some device answers. The survey asks every unit in several rounds. Each round has a
different pause between the requests, so that a device with a constant delay gets at least one reply through.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from smadrive.modbus.framing import rtu
from smadrive.modbus.requests import Request
from smadrive.modbus.transports.transport import Transport

PAUSES_S = (0.015, 0.019, 0.024)
"""Pauses in s after a request, one for each round. In each round, every unit gets one request."""


def units_to_ask(
    transport: Transport,
    unit_ids: Sequence[int],
    requests: Iterable[Request],
    patience_s: float,
    ask: Callable[[int], None],
) -> list[int]:
    """Return the units that replied. If some received bytes are not a whole reply, return all units.

    `requests` holds one request for each round, which goes to every unit. `patience_s` is the longest response time of
    a device. `ask(unit_id)` is called before each request.
    """
    transport.discard()
    heard: list[bytes] = []
    for request, pause_s in zip(requests, PAUSES_S, strict=False):
        for unit_id in unit_ids:
            ask(unit_id)
            frame = rtu.seal(unit_id, request.pdu)
            transport.write(frame)
            heard.append(_received(transport, pause_s + _wire_s(transport, len(frame))))
    patience_s += transport.latency_s + _wire_s(transport, rtu.MAX_FRAME)
    while tail := _received(transport, patience_s):
        heard.append(tail)
    replies = [data for data in heard if data]
    if all(rtu.crc_holds(data) and data[0] in unit_ids for data in replies):
        return [unit_id for unit_id in unit_ids if any(data[0] == unit_id for data in replies)]
    return [*unit_ids]


def _received(transport: Transport, wait_s: float) -> bytes:
    """Return all bytes that arrive within `wait_s`."""
    deadline_s = transport.clock.now_s() + wait_s
    received = b""
    while data := transport.read(deadline_s):
        received += data
    return received


def _wire_s(transport: Transport, size: int) -> float:
    """Return the time in s that `size` characters take on the line; 0 without a baud rate."""
    return 11 * size / transport.baudrate if transport.baudrate else 0.0
