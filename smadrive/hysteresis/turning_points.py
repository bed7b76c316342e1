"""The stack of turning points, with wiping-out.

`turns` alternates between minima and maxima of the input v. Its first entry is the lower end of the range, because a
wire was cold once. The length of `turns` gives the direction: if it is odd, v has been rising since the minimum
turns[-1]; if it is even, v has been falling since the maximum turns[-1]. When v passes the turning point before
the last, the last two turning points are forgotten, and the older section continues (wiping-out). When v falls to the
lower end of the range, this end alone remains, and the direction counts as rising: no relay is on any more.
"""

from __future__ import annotations

from typing import NamedTuple

MOST_TURNS = 100
"""The largest number of turning points. At a further reversal, the newest one and the new one are dropped."""

Turns = tuple[float, ...]


class Memory(NamedTuple):
    """The memory of a wire, in addition to its input and its state w.

    local     state of the T-S fuzzy Duhem rules; it stays at its first value if the plane has the share 1
    plane     state of the Preisach plane
    turns     turning points of the input, the oldest first; the first is the lower end of the range
    dropped   number of turning points that were dropped at the limit `MOST_TURNS`
    """

    local: float
    plane: float
    turns: Turns
    dropped: int = 0

    @property
    def rising(self) -> bool:
        """True if the input has been rising since its last turning point."""
        return is_rising(self.turns)


def is_rising(turns: Turns) -> bool:
    """Return True if the input has been rising since the last of `turns`."""
    return len(turns) % 2 == 1


class Piece(NamedTuple):
    """A part of a monotone move of the input, up to `end`, on the section that began at the turning point `turn`."""

    turn: float
    end: float


def reversed_at(turns: Turns, v: float) -> Turns:
    """Return the turning points after the input has reversed at v.

    If there are `MOST_TURNS` already, v is not added, and the newest turning point is dropped as well.
    """
    return (*turns, v) if len(turns) < MOST_TURNS else turns[:-1]


def stays(turns: Turns, end: float) -> bool:
    """Return True if a move of the input to `end` wipes out no turning point, so that the move is one piece.

    The direction of the move is the direction that the length of `turns` gives.
    """
    if is_rising(turns):
        return len(turns) == 1 or end < turns[-2]
    return end > turns[-2]


def pieces(turns: Turns, end: float) -> tuple[list[Piece], Turns]:
    """Return the pieces of a move of the input to `end`, and the turning points after this move.

    The direction of the move is the direction that the length of `turns` gives. Each pair of turning points that the
    move wipes out ends one piece; the last piece ends at `end`.
    """
    found = []
    rising = is_rising(turns)
    while len(turns) > 2 and (end >= turns[-2] if rising else end <= turns[-2]):
        found.append(Piece(turns[-1], turns[-2]))
        turns = turns[:-2]
    if len(turns) == 2 and end <= turns[0]:
        found.append(Piece(turns[1], end))
        return found, turns[:1]
    found.append(Piece(turns[-1], end))
    return found, turns
