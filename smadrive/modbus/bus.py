"""Timing, counters and trace of a bus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from smadrive.display.number_text import count_text

Direction = Literal["sent", "received", "discarded"]
Trace = Callable[[float, Direction, bytes], None]
"""Called as `trace(time_s, direction, bytes)` for each frame, each line of text, and each piece of discarded bytes."""


class GuardedTrace:
    """Passes frames to a trace. If the trace raises an error (full disk), it gets no more frames; the bus continues."""

    def __init__(self, trace: Trace | None) -> None:
        self._trace = trace
        self.failure: Exception | None = None

    @property
    def active(self) -> bool:
        """True if there is a trace and it has not failed."""
        return self._trace is not None

    def __call__(self, time_s: float, direction: Direction, data: bytes) -> None:
        """Give one frame to the trace. If the trace raises an error, store the error in `failure`."""
        if self._trace is None:
            return
        try:
            self._trace(time_s, direction, data)
        except Exception as failure:  # noqa: BLE001  (no error of a trace may stop the writing of a safe state)
            self._trace, self.failure = None, failure


NEVER_SILENT_S = 2.0
"""A quarantine (see bus_line.py) fails if bytes keep arriving for this time in seconds plus one response timeout."""


@dataclass(frozen=True, slots=True)
class BusTiming:
    """The timing that one device needs on the bus.

    response_timeout_s   longest wait for a reply; the time on the wire and the latency of the connection are added
    min_gap_s            shortest pause on the bus before a request to this device
    post_write_s         added to the pause after a write to this device
    interval_s           shortest time from a reply (or its missed deadline) to the next request to this device
    silence              True keeps at least the pause of the standard before a request; see `silence_s`
    read_retries         number of retries of a read; writes are never retried
    """

    response_timeout_s: float = 0.2
    min_gap_s: float = 0.0
    post_write_s: float = 0.0
    interval_s: float = 0.0
    silence: bool = True
    read_retries: int = 2


@dataclass(slots=True)
class BusCounters:
    """Counts of events on the bus since the client was created."""

    requests: int = 0
    replies: int = 0
    exceptions: int = 0
    timeouts: int = 0
    crc_errors: int = 0
    wrong_replies: int = 0
    stale_replies: int = 0
    retries: int = 0
    quarantines: int = 0
    probes: int = 0
    discarded_bytes: int = 0
    reopenings: int = 0

    @property
    def failures(self) -> dict[str, int]:
        """The number of requests that failed on the bus, by the reason; without reasons that did not occur.

        An exception is a right answer, so it is no failure of the bus.
        """
        counts = {
            "timeout": self.timeouts,
            "CRC error": self.crc_errors,
            "wrong frame": self.wrong_replies,
            "late frame": self.stale_replies,
        }
        return {reason: count for reason, count in counts.items() if count}

    def __str__(self) -> str:
        """Return the counts as text, such as `1204 requests, 3 failed: 2 timeouts, 1 CRC error`."""
        requests, failures = count_text(self.requests, "request"), self.failures
        if not failures:
            return f"{requests}, none failed"
        reasons = ", ".join(count_text(count, reason) for reason, count in failures.items())
        return f"{requests}, {sum(failures.values())} failed: {reasons}"


def silence_s(baudrate: int) -> float:
    """Return the pause between frames in seconds: 3.5 characters of 11 bits, but 1.75 ms above 19200 bits/s.

    Source: Modbus over serial line V1.02, section 2.5.1.1.
    """
    return 1.75e-3 if baudrate > 19200 else 3.5 * 11 / baudrate
