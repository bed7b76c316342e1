"""Computes the certificate of a model from the tables of its two branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from smadrive.hysteresis.certificate import ROUNDING, Certificate

if TYPE_CHECKING:
    from collections.abc import Iterable

    from smadrive.hysteresis.branch.engine import Branch, BranchEngine
    from smadrive.numerics.arrays import FloatArray


def certify(engine: BranchEngine, laws: Iterable[tuple[FloatArray, FloatArray]] | None = None) -> Certificate:
    """Return the certificate of the model whose branches are tabulated in `engine`.

    `laws` holds the coefficients (a, b) of the heating rules, then those of the cooling rules; a and b have the shape
    (rules,). A rule is dw/dv = a w + b. Without `laws`, the coefficients at the nodes of the tables are used.
    """
    (a_heating, b_heating), (a_cooling, b_cooling) = laws or (_law(engine.heating), _law(engine.cooling))
    up, down = engine.heating.exponent, engine.cooling.exponent
    return Certificate(
        contraction_rate=float(min(-a_heating.max(), a_cooling.min())),
        loop_contraction=float(np.exp(min(up[-1] - up[0] + down[0] - down[-1], 700.0))),
        bounded=_within(b_heating, -a_heating) and _within(-b_cooling, a_cooling),
        invertible_share=_invertible_share(engine),
        turned_share=turned_share(engine.heating.target, engine.cooling.target),
    )


def _law(branch: Branch) -> tuple[FloatArray, FloatArray]:
    return branch.rate, branch.target_slope - branch.rate * branch.target


def _within(drive: FloatArray, rate: FloatArray) -> bool:
    """Return True if 0 ≤ drive ≤ rate everywhere, up to rounding."""
    return bool(np.all(drive >= -ROUNDING * np.abs(rate)) and np.all(drive <= rate + ROUNDING * np.abs(rate)))


def _invertible_share(engine: BranchEngine) -> float:
    low = np.minimum(engine.heating.target, engine.cooling.target)
    high = np.maximum(engine.heating.target, engine.cooling.target)
    bottom, top = invertible_band(engine)
    good = np.clip(np.minimum(high, top) - np.maximum(low, bottom), 0.0, None)
    slack = ROUNDING * (engine.upper - engine.lower)
    area = float(np.trapezoid(high - low, engine.nodes))
    return min(1.0, (float(np.trapezoid(good, engine.nodes)) + slack) / area) if area > 0 else 1.0


def turned_share(heating: FloatArray, cooling: FloatArray) -> float:
    """Return the largest reversal of w along either branch of the major loop, as a share of the loop's travel.

    `heating` and `cooling` are w on the two branches at ascending inputs, both (nodes,). A reversal is a fall of w
    while the input increases.
    """
    travel = float(max(np.ptp(heating), np.ptp(cooling)))
    back = max(float(np.max(np.maximum.accumulate(branch) - branch)) for branch in (heating, cooling))
    return back / travel if travel > 0 else 0.0


def invertible_band(engine: BranchEngine) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest state w with a unique inverse at each node of the tables, both (nodes,).

    Between these two limits w rises while the input rises, and w falls while the input falls. A limit may be infinite.
    """
    (a_heating, b_heating), (a_cooling, b_cooling) = _law(engine.heating), _law(engine.cooling)
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.where(a_heating < 0, -b_heating / a_heating, np.where(b_heating >= 0, np.inf, -np.inf))
        bottom = np.where(a_cooling > 0, -b_cooling / a_cooling, np.where(b_cooling >= 0, -np.inf, np.inf))
    return bottom, top
