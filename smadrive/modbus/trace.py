"""A bus trace that a person can read. `firmware-sim --replay` can simulate the device from it.

    # smadrive bus trace 1: rtu
    # seconds, > sent or < received or x discarded, the bytes, their meaning
        0.200431 > 01 03 00 00 00 02 C4 0B | unit 1: read 2 holding registers from 0
        0.203120 < 01 03 04 53 4D 00 01 ... | unit 1: 21325 1

Each frame is one line. A reply that came in pieces is one line, at the time of its last piece. If no reply follows a
request, the request was not answered. The trace of a board that speaks text contains lines of text instead of
frames; `--replay` cannot use such a trace.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Self

from smadrive.errors import ConfigError
from smadrive.modbus import pdu_description
from smadrive.modbus.bus import Direction
from smadrive.modbus.framing import mbap, rtu
from smadrive.modbus.transports.transport import Transport

HEADER = "# smadrive bus trace 1:"

_LOG = logging.getLogger(__name__)

_MARKS: dict[Direction, str] = {"sent": ">", "received": "<", "discarded": "x"}
_DIRECTIONS = {mark: direction for direction, mark in _MARKS.items()}


class TraceLine(NamedTuple):
    """One line of a trace: time in seconds since the trace began, direction, and bytes of the frame."""

    time_s: float
    direction: Direction
    data: bytes


class TraceFile:
    """A file with every frame on the bus of `transport`: `ModbusClient(transport, trace=TraceFile(path, transport))`.

    It is a context manager. Times are in seconds since the trace began. A line is written after its frame has passed.
    If a line cannot be written (a full disk), the trace ends before this line, and a warning with time and reason is
    logged at the exit of the context. `speaks_text` is True for a board that exchanges lines of text instead of frames.
    """

    def __init__(self, path: Path, transport: Transport, *, speaks_text: bool = False) -> None:
        """Create the file. ConfigError when `path` exists already or cannot be written."""
        self._clock_start_s = transport.clock.now_s()
        self._numbered = transport.framing.numbered
        self._speaks_text = speaks_text
        self._path = path
        self._ended: str | None = None
        self._asked = b"\0"
        try:
            self._file = path.open("x", encoding="ascii", buffering=1)
        except FileExistsError:
            raise ConfigError("exists already", where=path, cure="use another folder, or remove the file") from None
        except OSError as error:
            raise _unwritable(path, error) from None
        kind = "text" if speaks_text else "tcp" if self._numbered else "rtu"
        try:
            self._file.write(f"{HEADER} {kind}, {transport.name}\n")
            self._file.write("# seconds, > sent or < received or x discarded, the bytes, their meaning\n")
        except OSError as error:
            with suppress(OSError):
                self._file.close()
            raise _unwritable(path, error) from None

    def __call__(self, time_s: float, direction: Direction, data: bytes) -> None:
        """Write one frame with its meaning. `time_s` is a time of the transport's clock."""
        if self._ended is not None:
            return
        meaning = self._meaning(direction, data)
        elapsed_s = time_s - self._clock_start_s
        line = f"{elapsed_s:12.6f} {_MARKS[direction]} {data.hex(' ').upper()}"
        try:
            self._file.write(f"{line} | {meaning}\n" if meaning else f"{line}\n")
        except OSError as error:
            self._ended = f"{self._path}: the trace ends at {elapsed_s:.3f} s ({error.strerror}). Free some space"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        with suppress(OSError):  # the last bytes could not be written
            self._file.close()
        if self._ended is not None:
            _LOG.warning(self._ended)

    def _meaning(self, direction: Direction, data: bytes) -> str:
        if direction == "discarded":
            return "not requested"
        if self._speaks_text:
            return data.decode("ascii", "backslashreplace").strip()
        content = content_of(data, numbered=self._numbered)
        if content is None:
            return "no intact frame"
        unit_id, pdu = content
        if direction == "sent":
            self._asked = pdu
            return f"unit {unit_id}: {pdu_description.of_request(pdu)}"
        return f"unit {unit_id}: {pdu_description.of_reply(pdu, self._asked)}"


def read_trace(path: Path) -> tuple[bool, list[TraceLine]]:
    """Return two values: True if the trace is of Modbus TCP (False for RTU), and its lines.

    ConfigError when the file cannot be read or is not a trace of Modbus. The `where` of the error names the file, and
    the number of a wrong line.
    """
    try:
        head, *rows = path.read_text(encoding="ascii").splitlines() or [""]
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError("cannot be read", where=path, value=error) from None
    if not head.startswith(HEADER):
        raise ConfigError("not a bus trace", where=path, cure=f"give a file that begins with '{HEADER}'")
    kind = head.removeprefix(HEADER).partition(",")[0].strip()
    if kind not in ("rtu", "tcp"):
        cure = "give a trace of rtu or tcp"
        raise ConfigError("a trace of this kind cannot be replayed as a device", where=path, value=kind, cure=cure)
    return kind == "tcp", [_line(path, number, row) for number, row in enumerate(rows, 2) if row and row[0] != "#"]


def content_of(frame: bytes, *, numbered: bool) -> tuple[int, bytes] | None:
    """Return unit id and PDU of a frame; None if the frame is damaged or incomplete.

    `numbered` is True for a Modbus TCP frame, False for an RTU frame.
    """
    if not numbered:
        return (frame[0], frame[1:-2]) if rtu.crc_holds(frame) else None
    whole = len(frame) > mbap.HEADER_SIZE and mbap.frame_size(frame) == len(frame)
    return (mbap.Header.of(frame).unit_id, frame[mbap.HEADER_SIZE :]) if whole else None


def _line(path: Path, number: int, row: str) -> TraceLine:
    try:
        time_s, mark, data = row.partition("|")[0].split(maxsplit=2)
        return TraceLine(float(time_s), _DIRECTIONS[mark], bytes.fromhex(data))
    except (ValueError, KeyError):
        raise ConfigError(
            "not a line of a trace",
            where=f"{path}, line {number}",
            value=row,
            cure="write the time, one of > < x, and the bytes",
        ) from None


def _unwritable(path: Path, error: OSError) -> ConfigError:
    cure = "check the folder and the free space on its disk"
    return ConfigError("the trace cannot be written", where=path, value=error.strerror, cure=cure)
