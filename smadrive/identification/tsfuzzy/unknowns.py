"""Positions of the unknowns of the rule problem in its vector x.

x = (rates p and q of every rule, times the input span; logits of the gaps between the centres, if the centres move;
     output at w = 0; output at w = 1; first state)
"""

from __future__ import annotations

from typing import NamedTuple

BOTTOM, TOP, FIRST_STATE = -3, -2, -1
"""Positions in x of the output at w = 0, of the output at w = 1 (in output spans), and of w at the first sample."""


class Unknowns(NamedTuple):
    """The positions of the unknowns in x, as slices, for `sets` fuzzy sets.

    `gaps` is the number of gaps between centres; 0 for fixed centres.
    """

    sets: int
    gaps: int

    @property
    def rates(self) -> slice:
        """The rates: p and q of the heating rules, then p and q of the cooling rules."""
        return slice(0, 4 * self.sets)

    @property
    def logits(self) -> slice:
        """The logits of the gaps between the centres."""
        return slice(4 * self.sets, 4 * self.sets + self.gaps)

    @property
    def centres(self) -> slice:
        """The columns of the centres in derivatives with respect to RuleRates. In x, the logits take their place."""
        return slice(4 * self.sets, 5 * self.sets)

    @property
    def contracting(self) -> tuple[slice, slice]:
        """The rates that keep the rules contracting: p of the heating and q of the cooling rules."""
        return slice(0, self.sets), slice(3 * self.sets, 4 * self.sets)
