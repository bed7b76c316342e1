"""Rules that never turn the wrong way: the condition for a unique inverse, in the fit and exactly on its result.

The slope is affine in w, so over the whole loop between its branches H (heating) and C (cooling) it has the right sign
where it has on the far branch:

    heating:  p(v) - (p + q)(v) C(v) ≥ 0           cooling:  q(v) - (p + q)(v) (1 - H(v)) ≥ 0

that is S ≥ C and R ≤ H. The loop is the closed one, which a full sweep up and down maps onto itself. In the fit slopes
of the wrong sign are penalised; what is left of them goes when q of the heating and p of the cooling rules shrink.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smadrive.hysteresis.arrays import FloatArray
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.sensitivity import RuleTables

_ROUNDS = 30  # shrinking q lifts H, shrinking p lowers C: few rounds settle
_MARGIN = 1e-9


class Loop(NamedTuple):
    """The closed loop at nodes: both branches, and how a state at the ends of the range decays along each."""

    heating: FloatArray
    cooling: FloatArray
    crossed: np.ndarray
    rise_decay: FloatArray
    fall_decay: FloatArray
    bottom: float
    top: float

    @property
    def lowest(self) -> FloatArray:
        """The least state in the loop; trial branches may cross."""
        return np.minimum(self.heating, self.cooling)

    @property
    def highest(self) -> FloatArray:
        """The greatest."""
        return np.maximum(self.heating, self.cooling)


def closed_loop(tables: RuleTables) -> Loop:
    """The closed loop of trial rules at the nodes of their tables."""
    up, down = tables.up, tables.down
    rise, fall = np.exp(up.exponent), np.exp(down.exponent - down.exponent[-1])
    bottom = (down.target[0] + (up.target[-1] - 1) * fall[0]) / (1 - rise[-1] * fall[0])
    top = up.target[-1] + bottom * rise[-1]
    heating, cooling = up.target + bottom * rise, down.target + (top - 1) * fall
    return Loop(heating, cooling, heating > cooling, rise, fall, float(bottom), float(top))


def least_slopes(tables: RuleTables) -> FloatArray:
    """The least slope of heating and of cooling within the loop at every node, (2, nodes)."""
    loop = closed_loop(tables)
    p_heating, q_heating, p_cooling, q_cooling = tables.rates_at_nodes
    return np.array(
        [
            p_heating - (p_heating + q_heating) * loop.highest,
            q_cooling - (p_cooling + q_cooling) * (1 - loop.lowest),
        ]
    )


def least_slope_derivatives(tables: RuleTables) -> FloatArray:
    """Their derivatives with respect to RuleRates in order, (2, nodes, 5 sets)."""
    loop, mu, sets = closed_loop(tables), tables.at_nodes, len(tables.rates.centres)
    d_heating, d_cooling = _branch_derivatives(tables, loop)
    crossed = loop.crossed[:, None]
    d_lowest, d_highest = np.where(crossed, d_cooling, d_heating), np.where(crossed, d_heating, d_cooling)
    p_heating, q_heating, p_cooling, q_cooling = (rate[:, None] for rate in tables.rates_at_nodes)
    p_h_slope, q_h_slope, p_c_slope, q_c_slope = tables.slopes_at_nodes
    far_heating, far_cooling = loop.highest[:, None], 1 - loop.lowest[:, None]
    heating, cooling = -(p_heating + q_heating) * d_highest, (p_cooling + q_cooling) * d_lowest
    first, second, third, fourth, moved = (slice(n * sets, (n + 1) * sets) for n in range(5))
    heating[:, first] += mu * (1 - far_heating)
    heating[:, second] -= mu * far_heating
    heating[:, moved] -= mu * (p_h_slope - (p_h_slope + q_h_slope) * loop.highest)[:, None]
    cooling[:, third] -= mu * far_cooling
    cooling[:, fourth] += mu * (1 - far_cooling)
    cooling[:, moved] -= mu * (q_c_slope - (p_c_slope + q_c_slope) * (1 - loop.lowest))[:, None]
    return np.array([heating, cooling])


def _branch_derivatives(tables: RuleTables, loop: Loop) -> tuple[FloatArray, FloatArray]:
    """∂H and ∂C at the nodes: those of the tabulated solutions, and of where the closed loop starts."""
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


def monotone(model: TSFuzzyDuhem) -> TSFuzzyDuhem:
    """`model` with q of the heating and p of the cooling rules shrunk just enough that no slope has the wrong sign."""
    p_heating, q_heating = model.heating_law[1], -model.heating_law[0] - model.heating_law[1]
    p_cooling, q_cooling = -model.cooling_law[1], model.cooling_law[0] + model.cooling_law[1]
    for _ in range(_ROUNDS):
        mu = model.sets.weights(model.engine.nodes)
        branches = model.engine.heating.target, model.engine.cooling.target
        share_q = _largest_share(mu, p_heating, q_heating, np.maximum(*branches))
        share_p = _largest_share(mu, q_cooling, p_cooling, 1 - np.minimum(*branches))
        if min(share_q.min(), share_p.min()) == 1:
            break
        q_heating, p_cooling = q_heating * share_q, p_cooling * share_p
        model = TSFuzzyDuhem(
            model.sets,
            a_heating=-(p_heating + q_heating),
            b_heating=p_heating,
            a_cooling=p_cooling + q_cooling,
            b_cooling=-p_cooling,
            scale=model.scale,
            offset=model.offset,
            input_range=model.input_range,
        )
    return model


def _largest_share(mu: FloatArray, gain: FloatArray, loss: FloatArray, far: FloatArray) -> FloatArray:
    """Share of each rule's loss that leaves gain (1 - far) - loss far ≥ 0 at all nodes where the rule is active."""
    room, need = (mu @ gain) * (1 - far), (mu @ loss) * far
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(need > room, room / need * (1 - _MARGIN), 1.0)
    active = np.where(mu > 0, share[:, None], 1.0)
    return np.asarray(np.clip(active.min(axis=0), 0.0, 1.0))
