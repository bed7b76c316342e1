"""The conformance frames of docs/sma-reference.md: requests in the order of sending, and the replies of map version 2.

The frames are for unit 1. They arm the board for some milliseconds, and command at most 30 mA.
"""

from __future__ import annotations

from typing import NamedTuple


class ConformanceFrame(NamedTuple):
    """A request, the right reply, and the meaning of both. The frames are hexadecimal digits with the CRC."""

    request: str
    reply: str
    meaning: str


CONFORMANCE = (
    ConformanceFrame("01 03 00 00 00 02 C4 0B", "01 03 04 53 4D 00 02 FA A1", "identity"),
    ConformanceFrame("01 06 00 30 00 FA 09 86", "01 06 00 30 00 FA 09 86", "watchdog 0.25 s"),
    ConformanceFrame("01 06 00 30 EA 60 C6 8D", "01 86 03 02 61", "watchdog 60 s: rejected"),
    ConformanceFrame("01 03 00 05 00 01 94 0B", "01 83 02 C0 F1", "an address that does not exist"),
    ConformanceFrame("01 04 00 00 00 01 31 CA", "01 84 01 82 C0", "a function that the board does not have"),
    ConformanceFrame("01 06 00 20 00 01 49 C0", "01 86 03 02 61", "a sequence below 256: rejected"),
    ConformanceFrame(
        "01 10 00 20 00 03 06 01 01 01 2C 00 01 DA 0E",
        "01 10 00 20 00 03 81 C2",
        "heat without being armed: accepted, no effect",
    ),
    ConformanceFrame("01 03 00 21 00 02 94 01", "01 03 04 00 00 00 00 FA 33", "current and enable still zero"),
    ConformanceFrame("01 06 00 28 12 34 04 B5", "01 86 03 02 61", "a wrong key: rejected"),
    ConformanceFrame("01 06 00 28 41 52 B8 6F", "01 06 00 28 41 52 B8 6F", "arm"),
    ConformanceFrame(
        "01 17 00 10 00 02 00 20 00 03 06 01 02 01 2C 00 01 D8 92",
        "01 17 04 01 02 00 01 98 DB",
        "tick: sequence 258, 30 mA, on; read echo and state",
    ),
    ConformanceFrame("01 06 00 28 41 52 B8 6F", "01 86 04 43 A3", "arm again: rejected"),
    ConformanceFrame("01 06 00 40 40 00 B9 DE", "01 86 04 43 A3", "calibrate while armed: rejected"),
    ConformanceFrame(
        "01 17 01 00 00 01 00 20 00 01 02 01 63 16 8B",
        "01 97 02 CF F1",
        "an illegal read range: rejected, nothing written",
    ),
    ConformanceFrame("01 03 00 20 00 01 85 C0", "01 03 02 01 02 38 15", "the sequence is still 258"),
    ConformanceFrame("01 06 00 22 00 00 29 C0", "01 06 00 22 00 00 29 C0", "off"),
    ConformanceFrame(
        "01 17 00 11 00 01 00 20 00 01 02 01 03 42 0F",
        "01 17 02 00 00 BD B4",
        "state idle, current zero",
    ),
    ConformanceFrame("01 03 00 46 00 01 65 DF", "01 03 02 00 00 B8 44", "a register that can only be written reads 0"),
)
