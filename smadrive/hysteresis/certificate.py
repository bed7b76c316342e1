"""Certificates of a branch model dw/dv = a w + b from linear system theory, checked rule by rule.

Contraction   a ≤ -λ on heating and a ≥ λ on cooling. Two trajectories with the same input approach each other as
              exp(-λ · TV(v)), where TV is the total variation of v. So the unknown initial state loses its effect
              after a known travel, and a periodic input has one attracting loop. Over a whole loop, differences shrink
              by the factor exp(-∮|a| dv), which is usually much smaller.
Boundedness   The equilibria S = -b/a (heating) and R = -b/a (cooling) lie in [0, 1], so w never leaves [0, 1].
Monotone      The slope is affine in w: w rises on heating where w < S(v), and falls on cooling where w > R(v). Between
              R(v) and S(v) the inverse is unique. In a Duhem model R = h₊ and S = h₋ are the branches, so the
              model is invertible everywhere. If a branch of the major loop itself reverses, the wire moves backwards
              during a full sweep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from smadrive.hysteresis.branch import Branch, BranchEngine
    from smadrive.numerics.arrays import FloatArray

_ROUNDING = 1e-9
MOST_TURNED = 0.2  # share of the travel; a saturated wire reverses by a tenth, because it expands with heat


@dataclass(frozen=True, slots=True)
class Certificate:
    """Proven properties of a model.

    contraction_rate   λ in 1/(unit of v); the model contracts if λ > 0
    loop_contraction   factor by which one loop over the whole range shrinks the distance of two trajectories
    bounded            True if w stays in [0, 1]
    invertible_share   share of the area between the major branches where w rises on heating and falls on cooling
    turned_share       largest reversal along either major branch, as a share of the loop's travel
    """

    contraction_rate: float
    loop_contraction: float
    bounded: bool
    invertible_share: float
    turned_share: float

    @property
    def contracting(self) -> bool:
        """True if the contraction rate is positive: trajectories approach each other on heating and on cooling."""
        return self.contraction_rate > 0

    @property
    def monotone(self) -> bool:
        """True if the inverse is unique for every state between the major branches."""
        return self.invertible_share > 1 - _ROUNDING

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

    def forgetting_travel(self, factor: float) -> float:
        """Return the travel of v that reduces the effect of an unknown initial state to `factor`, in the unit of v."""
        return float(np.log(1 / factor) / self.contraction_rate) if self.contracting else float("inf")


def certify(engine: BranchEngine, laws: Iterable[tuple[FloatArray, FloatArray]] | None = None) -> Certificate:
    """Return the certificate of a tabulated model.

    `laws` are (a, b) of the heating and of the cooling rules. Without them, a and b at the nodes of the table are used.
    """
    (a_heating, b_heating), (a_cooling, b_cooling) = laws or (_law(engine.heating), _law(engine.cooling))
    up, down = engine.heating.exponent, engine.cooling.exponent
    return Certificate(
        contraction_rate=float(min(-a_heating.max(), a_cooling.min())),
        loop_contraction=float(np.exp(min(up[-1] - up[0] + down[0] - down[-1], 700.0))),
        bounded=_within(b_heating, -a_heating) and _within(-b_cooling, a_cooling),
        invertible_share=_invertible_share(engine),
        turned_share=_turned_share(engine),
    )


def _law(branch: Branch) -> tuple[FloatArray, FloatArray]:
    return branch.rate, branch.target_slope - branch.rate * branch.target


def _within(drive: FloatArray, rate: FloatArray) -> bool:
    """Return True if 0 ≤ drive ≤ rate everywhere, up to rounding."""
    return bool(np.all(drive >= -_ROUNDING * np.abs(rate)) and np.all(drive <= rate + _ROUNDING * np.abs(rate)))


def _invertible_share(engine: BranchEngine) -> float:
    low = np.minimum(engine.heating.target, engine.cooling.target)
    high = np.maximum(engine.heating.target, engine.cooling.target)
    bottom, top = invertible_band(engine)
    good = np.clip(np.minimum(high, top) - np.maximum(low, bottom), 0.0, None)
    slack = _ROUNDING * (engine.upper - engine.lower)
    area = float(np.trapezoid(high - low, engine.nodes))
    return min(1.0, (float(np.trapezoid(good, engine.nodes)) + slack) / area) if area > 0 else 1.0


def _turned_share(engine: BranchEngine) -> float:
    heating, cooling = engine.heating.target, engine.cooling.target
    travel = float(max(np.ptp(heating), np.ptp(cooling)))
    back = max(float(np.max(np.maximum.accumulate(branch) - branch)) for branch in (heating, cooling))
    return back / travel if travel > 0 else 0.0


def invertible_band(engine: BranchEngine) -> tuple[FloatArray, FloatArray]:
    """Return R(v) and S(v) at the nodes of the table, both (nodes,).

    Between R and S the state rises on heating and falls on cooling.
    """
    (a_heating, b_heating), (a_cooling, b_cooling) = _law(engine.heating), _law(engine.cooling)
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.where(a_heating < 0, -b_heating / a_heating, np.where(b_heating >= 0, np.inf, -np.inf))
        bottom = np.where(a_cooling > 0, -b_cooling / a_cooling, np.where(b_cooling >= 0, -np.inf, np.inf))
    return bottom, top
