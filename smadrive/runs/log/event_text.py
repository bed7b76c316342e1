"""The texts of events: a text that is longer than one event of the file continues in the next events.

An event has a fixed length (layout.py), but a message with its cure must not be cut. Each part after the first one
begins with `CONTINUED`. No message of smadrive begins with this character.
"""

from __future__ import annotations

from collections.abc import Iterable

CONTINUED = "…"
"""First character of each part of a text after the first part. Other HDF5 readers show each part as one event."""


def parts_of(text: str, most_bytes: int) -> list[bytes]:
    """Return the text in UTF-8, as parts of at most `most_bytes` bytes, cut between characters."""
    data, mark, parts = text.encode(), b"", []
    while len(mark) + len(data) > most_bytes:
        end = most_bytes - len(mark)
        while data[end] & 0xC0 == 0x80:  # in the middle of a character
            end -= 1
        parts.append(mark + data[:end])
        data, mark = data[end:], CONTINUED.encode()
    return [*parts, mark + data]


def joined(events: Iterable[tuple[float, str]]) -> list[tuple[float, str]]:
    """Return the events of a log. An event whose text was stored in several parts is one event again."""
    whole: list[tuple[float, str]] = []
    for time_s, text in events:
        if whole and text.startswith(CONTINUED) and time_s == whole[-1][0]:
            whole[-1] = (time_s, whole[-1][1] + text.removeprefix(CONTINUED))
        else:
            whole.append((time_s, text))
    return whole
