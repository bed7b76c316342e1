"""Slopes of the right sign, which a unique inverse needs: their derivatives, and the correction of a fitted model.

The state w has two rates p, q ≥ 0 in each direction (see sensitivity.py): dw/dv = p(v)(1 - w) - q(v) w on heating, and
dw/dv = q(v) w - p(v)(1 - w) on cooling. H is the heating branch of the major loop, C its cooling branch. The slope is
affine in w. So it has the right sign everywhere between the branches if it has the right sign on the opposite branch:

    heating:  p(v) - (p(v) + q(v)) C(v) ≥ 0           cooling:  q(v) - (p(v) + q(v)) (1 - H(v)) ≥ 0

The loop is the closed loop over the whole range, even if the record does not cover this range; a full sweep up and down
ends where it began. A wire whose inner loops stay flat after a reversal cannot fulfil this condition. Then the
condition is required only up to a `depth` of the loop: 1 means the whole loop, 0 only the branches. In the condition,
H + depth (C - H) replaces C, and C - depth (C - H) replaces H.

The fit penalises slopes of the wrong sign. `monotone` removes the remaining wrong slopes from the result of the fit: it
makes q of the heating rules and p of the cooling rules smaller.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smadrive.hysteresis.tsfuzzy import MembershipGrid, TSFuzzyDuhem
from smadrive.identification.tsfuzzy.record_reversal import NOWHERE, Mask, RecordReversals
from smadrive.identification.tsfuzzy.sensitivity import RuleTables, laws_of, rates_of
from smadrive.numerics.arrays import FloatArray

_ROUNDS = 20  # a smaller q raises H, a smaller p lowers C: a few rounds suffice; later, rates become zero
_MARGIN = 3e-3  # rates shrink by this share more than needed, so that they need not shrink again


class Loop(NamedTuple):
    """The closed major loop of trial rules, at the nodes of their tables; a full sweep up and down ends where it began.

    heating, cooling         the state on both branches, (nodes,)
    crossed                  True at nodes where the heating branch is above the cooling branch, (nodes,)
    rise_decay, fall_decay   share that is left of an error of the state at the start of a sweep up or down, (nodes,)
    bottom, top              the states at the lower and at the upper end of the range
    """

    heating: FloatArray
    cooling: FloatArray
    crossed: np.ndarray
    rise_decay: FloatArray
    fall_decay: FloatArray
    bottom: float
    top: float

    @property
    def width(self) -> FloatArray:
        """Absolute distance of the two branches, (nodes,)."""
        return np.abs(self.cooling - self.heating)

    def highest(self, depth: float) -> FloatArray:
        """Return the states at the share `depth` of the way from the lower to the upper branch, (nodes,)."""
        return np.minimum(self.heating, self.cooling) + depth * self.width

    def lowest(self, depth: float) -> FloatArray:
        """Return the states at the share `depth` of the way from the upper to the lower branch, (nodes,)."""
        return np.maximum(self.heating, self.cooling) - depth * self.width


def closed_loop(tables: RuleTables) -> Loop:
    """Return the closed major loop of the trial rules in `tables`."""
    up, down = tables.up, tables.down
    rise, fall = np.exp(up.exponent), np.exp(down.exponent - down.exponent[-1])
    bottom = (down.target[0] + (up.target[-1] - 1) * fall[0]) / (1 - rise[-1] * fall[0])
    top = up.target[-1] + bottom * rise[-1]
    heating, cooling = up.target + bottom * rise, down.target + (top - 1) * fall
    return Loop(heating, cooling, heating > cooling, rise, fall, float(bottom), float(top))


def least_slopes(tables: RuleTables, depth: float) -> FloatArray:
    """Return the smallest slope dw/dv at each node, shape (2, nodes): first row heating, second row cooling.

    The minimum is taken over the states from a branch to the share `depth` of the way to the opposite branch.
    """
    loop = closed_loop(tables)
    p_heating, q_heating, p_cooling, q_cooling = tables.rates_at_nodes
    return np.array(
        [
            p_heating - (p_heating + q_heating) * loop.highest(depth),
            q_cooling - (p_cooling + q_cooling) * (1 - loop.lowest(depth)),
        ]
    )


def least_slope_derivatives(tables: RuleTables, depth: float) -> FloatArray:
    """Return the derivatives of `least_slopes` with respect to the rates and centres of the rules.

    The shape is (2, nodes, 5 · sets); the last axis has the order of the fields of RuleRates.
    """
    loop, mu, sets = closed_loop(tables), tables.at_nodes, len(tables.rates.centres)
    d_heating, d_cooling = _branch_derivatives(tables, loop)
    crossed = loop.crossed[:, None]
    d_lower, d_upper = np.where(crossed, d_cooling, d_heating), np.where(crossed, d_heating, d_cooling)
    highest, lowest = loop.highest(depth), loop.lowest(depth)
    d_highest, d_lowest = d_lower + depth * (d_upper - d_lower), d_upper - depth * (d_upper - d_lower)
    p_heating, q_heating, p_cooling, q_cooling = (rate[:, None] for rate in tables.rates_at_nodes)
    p_h_slope, q_h_slope, p_c_slope, q_c_slope = tables.slopes_at_nodes
    far_heating, far_cooling = highest[:, None], 1 - lowest[:, None]
    heating, cooling = -(p_heating + q_heating) * d_highest, (p_cooling + q_cooling) * d_lowest
    first, second, third, fourth, moved = (slice(n * sets, (n + 1) * sets) for n in range(5))
    heating[:, first] += mu * (1 - far_heating)
    heating[:, second] -= mu * far_heating
    heating[:, moved] -= mu * (p_h_slope - (p_h_slope + q_h_slope) * highest)[:, None]
    cooling[:, third] -= mu * far_cooling
    cooling[:, fourth] += mu * (1 - far_cooling)
    cooling[:, moved] -= mu * (q_c_slope - (p_c_slope + q_c_slope) * (1 - lowest))[:, None]
    return np.array([heating, cooling])


def _branch_derivatives(tables: RuleTables, loop: Loop) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of H and C with respect to the rates and centres, both (nodes, 5 · sets).

    They follow from the derivatives of the tabulated solutions and of the states at the ends of the range.
    """
    up, down = tables.sensitivities
    rise, fall = loop.rise_decay[:, None], loop.fall_decay[:, None]
    d_rise, d_fall = rise * up.exponent, fall * (down.exponent - down.exponent[-1])
    open_top = tables.up.target[-1] - 1
    turned = down.target[0] + up.target[-1] * fall[0] + open_top * d_fall[0]
    turned = turned + loop.bottom * (d_rise[-1] * fall[0] + rise[-1] * d_fall[0])
    d_bottom = turned / (1 - rise[-1] * fall[0])
    d_top = up.target[-1] + d_bottom * rise[-1] + loop.bottom * d_rise[-1]
    heating = up.target + d_bottom * rise + loop.bottom * d_rise
    return heating, down.target + d_top * fall + (loop.top - 1) * d_fall


def monotone(model: TSFuzzyDuhem, depth: float = 1.0, reversals: RecordReversals = NOWHERE) -> TSFuzzyDuhem:
    """Return `model` with its rules changed so that the slope dw/dv is not negative.

    This holds from each branch to the share `depth` of the way to the opposite branch: depth 1 is the whole loop. The
    rates q of the heating rules and p of the cooling rules are reduced as little as possible. Rules that are active
    where the wire itself reverses (`reversals`) stay as they are.
    """
    p_heating, q_heating, p_cooling, q_cooling = rates_of(model).reshape(4, -1)
    grid, (up, down) = MembershipGrid(model.sets, model.engine.nodes), reversals.at(model.engine.nodes)
    mu, heating, cooling = grid.at_nodes, model.engine.heating.target, model.engine.cooling.target
    for number in range(_ROUNDS + 2 * len(p_heating)):
        beyond = depth * np.maximum(cooling - heating, 0.0)  # branches that saturate together may cross a little
        share_q = _largest_share(mu, p_heating, q_heating, heating + beyond, up)
        share_p = _largest_share(mu, q_cooling, p_cooling, 1 - cooling + beyond, down)
        if min(share_q.min(), share_p.min()) == 1:
            break
        if number >= _ROUNDS:
            share_q, share_p = np.floor(share_q), np.floor(share_p)
        q_heating, p_cooling = q_heating * share_q, p_cooling * share_p
        branches = grid.closed_branches(*laws_of(p_heating, q_heating, p_cooling, q_cooling))
        heating, cooling = (branch.target for branch in branches)
    laws = laws_of(p_heating, q_heating, p_cooling, q_cooling)
    return TSFuzzyDuhem.from_laws(model.sets, *laws, model.scale, model.offset, model.input_range)


def _largest_share(mu: FloatArray, gain: FloatArray, loss: FloatArray, far: FloatArray, turns: Mask) -> FloatArray:
    """Return the largest share of each rule's `loss` with which gain (1 - far) - loss far ≥ 0 at all nodes of the rule.

    `gain` and `loss` are p and q of the heating rules, or q and p of the cooling rules. `far` is the farthest state
    towards the opposite branch: w for heating rules, 1 - w for cooling rules. `turns` is True where the wire itself
    reverses. Only rules that have the wrong sign themselves get a share below 1, so that they change before their
    neighbours.
    """
    room, need = (mu @ gain) * (1 - far), (mu @ loss) * far
    short = need > room
    mu_short, far_short = mu[short], far[short]
    wrong = np.outer(1 - far_short, gain) < np.outer(far_short, loss)
    its_need = ((mu_short * wrong) @ loss) * far_short
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (1 - (need - room)[short] / its_need) * (1 - _MARGIN)
    active = np.where(wrong & (mu_short > 0), share[:, None], 1.0)
    least = np.clip(active.min(axis=0, initial=1.0), 0.0, 1.0)
    return np.asarray(np.where((mu[turns] > 0).any(axis=0), 1.0, least))
