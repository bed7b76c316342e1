"""Positions of the unknowns of the rule problem in its vector x.

x holds, in this order: the rates p and q of every rule, times the input span; the logits of the gaps between the
centres, if the centres move; the output at w = 0 and the output at w = 1, in output spans; the first state. The softmax
function of the logits gives the gaps.
"""

from __future__ import annotations

from typing import NamedTuple

BOTTOM, TOP, FIRST_STATE = -3, -2, -1
"""Positions in x of the output at w = 0, of the output at w = 1 (in output spans), and of w at the first sample."""


class Unknowns(NamedTuple):
    """The positions of the unknowns in the vector x, as slices, for `sets` fuzzy sets.

    `gaps` is the number of gaps between the centres and the ends of the range; 0 for fixed centres.
    """

    sets: int
    gaps: int

    @property
    def rates(self) -> slice:
        """Position of the rates in x: p and q of the heating rules, then p and q of the cooling rules."""
        return slice(0, 4 * self.sets)

    @property
    def logits(self) -> slice:
        """Position of the logits in x, one logit for each gap between the centres."""
        return slice(4 * self.sets, 4 * self.sets + self.gaps)

    @property
    def centres(self) -> slice:
        """Position of the centres among the columns of a derivative with respect to RuleRates; x has no centres."""
        return slice(4 * self.sets, 5 * self.sets)

    @property
    def contracting(self) -> tuple[slice, slice]:
        """Positions of the rates that keep the rules contracting: p of the heating rules, q of the cooling rules."""
        return slice(0, self.sets), slice(3 * self.sets, 4 * self.sets)
