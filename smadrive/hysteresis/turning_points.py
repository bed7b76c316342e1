"""The stack of turning points, with wiping-out.

`turns` alternates between minima and maxima of the input and begins with the lower end of the range: a wire was cold
once. So its length tells the direction: an odd length means that v has been rising since turns[-1], which is a minimum.
When v passes the turning point before the last, both are forgotten, and the older section goes on (wiping-out).
"""

from __future__ import annotations

from typing import NamedTuple

MOST_TURNS = 100
"""The largest number of turning points. At the next reversal the two newest are dropped: the smallest loop."""

Turns = tuple[float, ...]


class Memory(NamedTuple):
    """What a wire remembers besides its input and its state w.

    local     state x of the rules
    plane     state p of the Preisach plane
    turns     turning points of the input, the oldest first; the first is the lower end of the range
    dropped   number of turning points that were dropped because there were more than `MOST_TURNS`
    """

    local: float
    plane: float
    turns: Turns
    dropped: int = 0

    @property
    def rising(self) -> bool:
        """True if the input has been rising since its last turning point."""
        return len(self.turns) % 2 == 1


class Piece(NamedTuple):
    """A part of a monotone move: the input moves to `end` on the section that began at the turning point `turn`."""

    turn: float
    end: float


def reversed_at(turns: Turns, v: float) -> Turns:
    """Return the turning points after the input has reversed at v. See `MOST_TURNS`."""
    return (*turns, v) if len(turns) < MOST_TURNS else turns[:-1]


def pieces(turns: Turns, end: float) -> tuple[list[Piece], Turns]:
    """Return the pieces of a move to `end` in the direction of `turns`, and the turning points after it.

    A move has one piece more than it wipes out pairs of turning points.
    """
    found = []
    rising = len(turns) % 2 == 1
    while len(turns) > 2 and (end >= turns[-2] if rising else end <= turns[-2]):
        found.append(Piece(turns[-1], turns[-2]))
        turns = turns[:-2]
    if len(turns) == 2 and end <= turns[0]:
        found.append(Piece(turns[1], end))
        return found, turns[:1]
    found.append(Piece(turns[-1], end))
    return found, turns
