"""Positions of the unknowns of the rule problem in its vector x.

x = (rates p, q of every rule · span, logits of the gaps between centres if they move, bottom, top, first state)
"""

from __future__ import annotations

from typing import NamedTuple

BOTTOM, TOP, FIRST_STATE = -3, -2, -1
"""Output at w = 0 and at w = 1 in output spans, and the state w at the first sample."""


class Unknowns(NamedTuple):
    """Slices of x for so many sets and gaps; `gaps` is 0 for centres that are given."""

    sets: int
    gaps: int

    @property
    def rates(self) -> slice:
        """P and q of the heating rules, then p and q of the cooling rules."""
        return slice(0, 4 * self.sets)

    @property
    def logits(self) -> slice:
        """The logits of the gaps."""
        return slice(4 * self.sets, 4 * self.sets + self.gaps)

    @property
    def centres(self) -> slice:
        """The columns of the centres in derivatives with respect to RuleRates; x has the logits in their place."""
        return slice(4 * self.sets, 5 * self.sets)

    @property
    def contracting(self) -> tuple[slice, slice]:
        """The rates that keep the rules contracting: p of the heating and q of the cooling rules."""
        return slice(0, self.sets), slice(3 * self.sets, 4 * self.sets)
