"""States of a T-S fuzzy Duhem model along a record, and their exact derivatives with respect to every rule.

Rules with triangular sets are described by two non-negative rates, p towards w = 1 and q towards w = 0:

    heating:  dw/dv =   p(v)(1 - w) - q(v) w        cooling:  dw/dv = -(p(v)(1 - w) - q(v) w)        p = Σ μ_i p_i, ...

v is the input, w the state, and μ_i the membership of the set i with the centre c_i. The model contracts if p + q > 0,
and it is bounded because the rates are not negative. Let θ be a rate or a centre. The derivative z = ∂w/∂θ obeys the
same linear ODE as w, with the drive f = ∂(dw/dv)/∂θ. A move of the centre c_i changes the piecewise linear p(v):

    ∂p/∂c_i = -p'(v) μ_i(v)

The closed form of the state is w = P + (w0 - P0) exp(Λ - Λ0), see hysteresis/branch/engine.py. P is a particular
solution and Λ the integral of a; w0, P0 and Λ0 are the values at the start of a section. So the derivatives at all
samples follow from tables of ∂P and ∂Λ, which are computed once per iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smadrive.hysteresis.branch.engine import Branch, BranchEngine
from smadrive.hysteresis.branch.tabulate import (
    WEIGHTS,
    cell_maps,
    integrate_rate,
    march,
    quadrature_points,
    uniform_grid,
)
from smadrive.hysteresis.fuzzy import hat_weights
from smadrive.hysteresis.tsfuzzy import Law, TSFuzzyDuhem
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.interpolation_matrix import InterpolationMatrix

BINS = 240  # table cells of a trial model

LEAST_RATE = 1e-3
"""Lower limit of p of each heating rule and of q of each cooling rule, in 1/(input span).

With this limit every rule contracts.
"""


class RuleRates(NamedTuple):
    """The rates of the rules and the centres of their sets; each field has one number per set.

    p is the rate towards w = 1 and q the rate towards w = 0, both in 1/(unit of v).
    """

    p_heating: FloatArray
    q_heating: FloatArray
    p_cooling: FloatArray
    q_cooling: FloatArray
    centres: FloatArray


def laws_of(
    p_heating: FloatArray, q_heating: FloatArray, p_cooling: FloatArray, q_cooling: FloatArray
) -> tuple[Law, Law]:
    """Return the consequents (a, b) of the heating rules and of the cooling rules with these rates.

    A rule is dw/dv = a w + b. The rates p (towards w = 1) and q (towards w = 0), a and b have one number per set.
    """
    return (-(p_heating + q_heating), p_heating), (p_cooling + q_cooling, -p_cooling)


def rates_of(model: TSFuzzyDuhem) -> FloatArray:
    """Return the rates of the rules of a model in the order of `laws_of`, shape (4 · sets,)."""
    (a_heating, b_heating), (a_cooling, b_cooling) = model.heating_law, model.cooling_law
    return np.concatenate([b_heating, -a_heating - b_heating, -b_cooling, a_cooling + b_cooling])


class Runs:
    """The monotone sections of an input path `v` (samples,).

    `starts` and `ends` are the indices of the first and the last sample of each section. `rising` and `run` have one
    value for each step between two samples: `rising` is True if the input rises, and `run` is the number of the
    section.
    """

    def __init__(self, v: FloatArray) -> None:
        self.v = v
        self.rising = v[1:] > v[:-1]
        self.starts = np.concatenate([[0], np.flatnonzero(self.rising[1:] != self.rising[:-1]) + 1])
        self.ends = np.concatenate([self.starts[1:], [len(v) - 1]])
        self.run = np.repeat(np.arange(len(self.starts)), self.ends - self.starts)


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """The derivatives of one branch with respect to the rules, at the nodes; both fields are (nodes, 5 · sets).

    The law of the branch is dw/dv = a w + b. `target` holds the derivatives of the tabulated particular solution,
    `exponent` those of the integral of a. The columns have the order of the fields of RuleRates.
    """

    target: FloatArray
    exponent: FloatArray


class RuleTables:
    """Tables of trial rules over the input range [lower, upper], with derivatives with respect to the rules."""

    def __init__(self, rates: RuleRates, lower: float, upper: float) -> None:
        self.rates = rates
        self.nodes = uniform_grid(lower, upper, BINS, rates.centres)
        self.points = quadrature_points(self.nodes)
        self.at_points = hat_weights(self.points, rates.centres)
        self.at_nodes = hat_weights(self.nodes, rates.centres)
        self.up, self._up_maps = self._branch(rates.p_heating, rates.q_heating, rising=True)
        self.down, self._down_maps = self._branch(rates.p_cooling, rates.q_cooling, rising=False)
        self.engine = BranchEngine(self.nodes, BINS, self.up, self.down)

    def _branch(self, p: FloatArray, q: FloatArray, *, rising: bool) -> tuple[Branch, FloatArray]:
        sign = 1.0 if rising else -1.0
        cells = integrate_rate(self.nodes, -sign * (self.at_points @ (p + q)))
        gain, shift = cell_maps(self.nodes, cells, sign * (self.at_points @ p), rising=rising)
        target = march(0.0 if rising else 1.0, gain, shift, rising=rising)
        rate = -sign * (self.at_nodes @ (p + q))
        branch = Branch(cells.exponent, rate, target, rate * target + sign * (self.at_nodes @ p))
        end = cells.exponent[1:] if rising else cells.exponent[:-1]
        weight = np.exp(end[:, None] - cells.inner_exponent) * WEIGHTS * np.diff(self.nodes)[:, None]
        return branch, weight

    @cached_property
    def sensitivities(self) -> tuple[Sensitivity, Sensitivity]:
        """The derivatives of the heating branch and of the cooling branch with respect to the rules."""
        return (
            self._sensitivity(self.up, self._up_maps, rising=True),
            self._sensitivity(self.down, self._down_maps, rising=False),
        )

    @property
    def rates_at_nodes(self) -> list[FloatArray]:
        """The rates p, q of heating and p, q of cooling at the nodes, blended from all rules: four arrays (nodes,)."""
        return [self.at_nodes @ rate for rate in self.rates[:4]]

    @property
    def slopes_at_nodes(self) -> list[FloatArray]:
        """Derivatives of `rates_at_nodes` with respect to v."""
        return [self._slopes(rate, self.nodes) for rate in self.rates[:4]]

    def states(self, runs: Runs, w_start: float) -> FloatArray:
        """Return the state w at every sample of the path `runs`, (samples,). The first state is `w_start`."""
        return self.engine.trajectory(runs.v, w_start)

    def jacobian(self, runs: Runs, w: FloatArray) -> InterpolationMatrix:
        """Return the derivatives of the state at every sample of `runs`, shape (samples, 5 · sets + 1).

        `w` (samples,) are the states. The columns have the order of the fields of RuleRates; the last column belongs to
        the first state. P is the tabulated solution, Λ its exponent. Within a section of `runs`,

            ∂w = ∂P + D e ∂Λ + D (∂e₀ - e ∂Λ₀)        e = w₀ - P₀,  D the decay of e since the start of the section

        Index 0 is the start of the section. ∂P and ∂Λ are interpolated between two nodes of the tables. The bracket
        does not change within a section.
        """
        up, down = self.sensitivities
        rows = np.zeros((4 * len(self.nodes) + 1 + len(runs.starts), up.target.shape[1] + 1))
        tables, first, entries = np.split(rows, [4 * len(self.nodes), 4 * len(self.nodes) + 1])
        np.concatenate([down.target, up.target, down.exponent, up.exponent], out=tables[:, :-1])
        first[0, -1] = 1.0
        start_v, start_rising = runs.v[runs.starts], runs.rising[runs.starts]
        target, exponent = self.engine.evaluate(start_v, start_rising)
        excess = w[runs.starts] - target
        decay = np.exp(self.engine.evaluate(runs.v[1:], runs.rising)[1] - exponent[runs.run])
        moves = self._matrix(runs.v[1:], runs.rising, excess[runs.run] * decay, rows)
        entered, last = self._matrix(start_v, start_rising, excess, rows).at(slice(None)), runs.ends - 1
        gained = moves.at(last) - decay[last, None] * entered
        np.subtract(march(first[0], decay[last], gained, rising=True)[:-1], entered, out=entries)
        places = np.column_stack([moves.places, (len(tables) + 1 + runs.run).astype(np.int32)])
        shares = np.column_stack([moves.shares, decay])
        first_places = np.full((1, 5), len(tables), dtype=np.int32)
        return InterpolationMatrix(np.vstack([first_places, places]), np.vstack([np.eye(1, 5), shares]), rows)

    def _sensitivity(self, branch: Branch, weight: FloatArray, *, rising: bool) -> Sensitivity:
        rates, mu, width = self.rates, self.at_points, np.diff(self.nodes)
        sets = len(rates.centres)
        p, q = (rates.p_heating, rates.q_heating) if rising else (rates.p_cooling, rates.q_cooling)
        w = self.engine.evaluate(self.points.ravel(), np.full(self.points.size, rising))[0].reshape(self.points.shape)
        middle = (self.nodes[1:] + self.nodes[:-1]) / 2
        p_slope, q_slope = (self._slopes(rate, middle)[:, None] for rate in (p, q))
        drives = np.stack([1 - w, -w, q_slope * w - p_slope * (1 - w)], axis=1)  # of the law, by p, q, centres
        forced = (weight[:, None] * drives) @ mu  # on cooling, the sign of the law and the falling input cancel
        met = (WEIGHTS @ mu) * width[:, None]
        turned = np.hstack([-met, -met, (p_slope + q_slope) * met])
        change = np.diff(branch.exponent)
        gain = np.exp(change if rising else -change)
        target, exponent = np.zeros((2, len(self.nodes), 5 * sets))
        own_rates = np.arange(2 * sets) + (0 if rising else 2 * sets)
        mine = np.concatenate([own_rates, np.arange(4 * sets, 5 * sets)])
        target[:, mine] = march(np.zeros(3 * sets), gain, forced.reshape(len(width), -1), rising=rising)
        exponent[1:, mine] = np.cumsum(turned if rising else -turned, axis=0)
        return Sensitivity(target, exponent)

    def _slopes(self, rate: FloatArray, v: FloatArray) -> FloatArray:
        """Return the derivative of the blended `rate` with respect to v; it is zero outside all centres."""
        slopes = np.concatenate([[0.0], np.diff(rate) / np.diff(self.rates.centres), [0.0]])
        return np.asarray(slopes[np.searchsorted(self.rates.centres, v)])

    def _matrix(
        self, v: FloatArray, rising: NDArray[np.bool_], excess: FloatArray, rows: FloatArray
    ) -> InterpolationMatrix:
        """Return ∂P + excess ∂Λ at the inputs v.

        The first 4 · nodes `rows` are ∂P of cooling, ∂P of heating, ∂Λ of cooling and ∂Λ of heating.
        """
        nodes = len(self.nodes)
        cell = np.clip(np.searchsorted(self.nodes, v, side="right") - 1, 0, nodes - 2)
        share = (v - self.nodes[cell]) / (self.nodes[cell + 1] - self.nodes[cell])
        target = cell + nodes * rising
        places = np.column_stack([target, target + 1, target + 2 * nodes, target + 2 * nodes + 1])
        shares = np.column_stack([1 - share, share, excess * (1 - share), excess * share])
        return InterpolationMatrix(places.astype(np.int32), shares, rows)
