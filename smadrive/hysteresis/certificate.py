"""Certificates of a model whose state w follows dw/dv = a w + b, from linear system theory.

For fuzzy rules, contraction and boundedness are proven rule by rule. For a Duhem model, both are checked at the nodes
of its tables. All other properties are checked at the nodes of the tables.

Contraction   a ≤ -λ on heating and a ≥ λ on cooling, with λ > 0. The distance of two trajectories with the same input v
              shrinks at least as exp(-λ · TV(v)), where TV is the total variation of v. So the unknown initial state
              loses its effect after a known travel of v, and a periodic input has one attracting loop. λ is the
              smallest |a|. Over a whole loop, the distance shrinks by a stronger factor: exp(-∮|a| dv).
Boundedness   The equilibria S = -b/a (heating) and R = -b/a (cooling) lie in [0, 1], so w never leaves [0, 1].
Monotone      The slope is affine in w: w rises on heating where w < S(v), and falls on cooling where w > R(v). Between
              R(v) and S(v) the inverse is unique. In a Duhem model R is the heating branch and S the cooling branch,
              so this model is invertible everywhere. If a branch of the major loop itself reverses, the wire moves
              backwards during a full sweep.
"""

from __future__ import annotations

from dataclasses import dataclass

ROUNDING = 1e-9
MOST_TURNED = 0.2  # share of the travel; a saturated wire reverses by a tenth, because it expands with heat


@dataclass(frozen=True, slots=True)
class Certificate:
    """Proven properties of a model with the input v and the state w.

    contraction_rate   λ in 1/(unit of v): a travel s of v multiplies the distance of two states by at most exp(-λ s)
    loop_contraction   factor by which one loop over the whole range multiplies the distance of two states
    bounded            True if w stays in [0, 1]
    invertible_share   share of the area between the major branches where w rises on heating and falls on cooling
    turned_share       largest reversal of w along either branch of the major loop, as a share of the loop's travel
    """

    contraction_rate: float
    loop_contraction: float
    bounded: bool
    invertible_share: float
    turned_share: float

    @property
    def contracting(self) -> bool:
        """True if the contraction rate is positive: the distance of two states shrinks on heating and on cooling."""
        return self.contraction_rate > 0

    @property
    def holds(self) -> bool:
        """True if the model may drive a feedforward: contracting, bounded, and `turned_share` at most `MOST_TURNED`."""
        return not self.shortcomings

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """The reasons why the certificate does not hold, one phrase each; empty if it holds."""
        found = []
        if not self.contracting:
            found.append(f"it does not contract (contraction_rate {self.contraction_rate:.3g})")
        if not self.bounded:
            found.append("its output is not bounded")
        if self.turned_share > MOST_TURNED:
            found.append(f"a branch reverses by {100 * self.turned_share:.0f} % of the travel")
        return tuple(found)
