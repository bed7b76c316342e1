"""States of a T-S fuzzy Duhem model along a record, and their exact derivatives with respect to every rule.

Rules with triangular sets are written by two non-negative rates, towards 1 and towards 0:

    heating:  dw/dv =   p(v)(1 - w) - q(v) w        cooling:  dw/dv = -(p(v)(1 - w) - q(v) w)        p = Σ μ_i p_i, ...

so contraction is p + q > 0 and boundedness comes with the signs. A derivative z = ∂w/∂θ obeys the same linear ODE with
another drive, f = ∂(dw/dv)/∂θ; moving a centre c_i changes a piecewise linear law by ∂p/∂c_i = -p'(v) μ_i(v). With the
closed form w = P + (w0 - P0) exp(Λ - Λ0) it is enough to tabulate ∂P and ∂Λ once per iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from smadrive.hysteresis.arrays import FloatArray
from smadrive.hysteresis.branch import Branch, BranchEngine
from smadrive.hysteresis.fuzzy import hat_weights
from smadrive.hysteresis.tabulate import WEIGHTS, cell_maps, integrate_rate, march, quadrature_points, uniform_grid

BINS = 240  # table cells of a trial model


class RuleRates(NamedTuple):
    """The rates p and q of both directions and the centres, one number per set each."""

    p_heating: FloatArray
    q_heating: FloatArray
    p_cooling: FloatArray
    q_cooling: FloatArray
    centres: FloatArray


class Runs:
    """The monotone runs of a path: where each starts and ends, and its direction."""

    def __init__(self, v: FloatArray) -> None:
        self.v = v
        self.rising = v[1:] > v[:-1]
        self.starts = np.concatenate([[0], np.flatnonzero(self.rising[1:] != self.rising[:-1]) + 1])
        self.ends = np.concatenate([self.starts[1:], [len(v) - 1]])
        self.run = np.repeat(np.arange(len(self.starts)), self.ends - self.starts)


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """∂P and ∂Λ of one branch at the nodes, (nodes, 5 · sets); columns ordered like RuleRates."""

    target: FloatArray
    exponent: FloatArray


class RuleTables:
    """The branch engine of trial rules over [lower, upper]."""

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
        """Of the heating and of the cooling branch."""
        return (
            self._sensitivity(self.up, self._up_maps, rising=True),
            self._sensitivity(self.down, self._down_maps, rising=False),
        )

    @property
    def rates_at_nodes(self) -> list[FloatArray]:
        """The four blended rates at the nodes."""
        return [self.at_nodes @ rate for rate in self.rates[:4]]

    @property
    def slopes_at_nodes(self) -> list[FloatArray]:
        """Their derivatives with respect to v."""
        return [self._slopes(rate, self.nodes) for rate in self.rates[:4]]

    def states(self, runs: Runs, w_start: float) -> FloatArray:
        """State w at every sample."""
        return self.engine.trajectory(runs.v, w_start)

    def jacobian(self, runs: Runs, w_start: float) -> FloatArray:
        """∂w at every sample with respect to (RuleRates in order, w_start): (samples, 5 · sets + 1)."""
        up, down = self.sensitivities
        target, exponent = self.engine.evaluate(runs.v[1:], runs.rising)
        start_rising = runs.rising[runs.starts]
        start_target, start_exponent = self.engine.evaluate(runs.v[runs.starts], start_rising)
        d_target, d_exponent = self._interpolate(up, down, runs.v[1:], runs.rising)
        d_start_target, d_start_exponent = self._interpolate(up, down, runs.v[runs.starts], start_rising)
        decay = np.exp(exponent - start_exponent[runs.run])
        d_exponent -= d_start_exponent[runs.run]
        result = np.zeros((len(runs.v), d_target.shape[1] + 1))
        result[0, -1] = 1.0
        w, dw = w_start, result[0].copy()
        for number, (start, end) in enumerate(zip(runs.starts, runs.ends, strict=True)):
            moves = slice(start, end)
            excess = w - start_target[number]
            dw[:-1] -= d_start_target[number]
            rows = result[start + 1 : end + 1]
            np.multiply(decay[moves, None], dw, out=rows)
            rows[:, :-1] += d_target[moves] + (excess * decay[moves])[:, None] * d_exponent[moves]
            w = float(target[end - 1] + excess * decay[end - 1])
            dw = rows[-1].copy()
        return result

    def _sensitivity(self, branch: Branch, weight: FloatArray, *, rising: bool) -> Sensitivity:
        rates, mu, width = self.rates, self.at_points, np.diff(self.nodes)
        sets = len(rates.centres)
        p, q = (rates.p_heating, rates.q_heating) if rising else (rates.p_cooling, rates.q_cooling)
        first = 0 if rising else 2 * sets
        columns = (slice(first, first + sets), slice(first + sets, first + 2 * sets), slice(4 * sets, 5 * sets))
        w = self.engine.evaluate(self.points.ravel(), np.full(self.points.size, rising))[0].reshape(self.points.shape)
        middle = (self.nodes[1:] + self.nodes[:-1]) / 2
        p_slope, q_slope = (self._slopes(rate, middle) for rate in (p, q))
        sign = 1.0 if rising else -1.0
        drives = (1 - w, -w, -(p_slope[:, None] * (1 - w) - q_slope[:, None] * w))
        rate_drives = (-np.ones_like(w), -np.ones_like(w), np.broadcast_to((p_slope + q_slope)[:, None], w.shape))
        forced = np.zeros((len(width), 5 * sets))
        turned = np.zeros((len(width), 5 * sets))
        for column, drive, rate_drive in zip(columns, drives, rate_drives, strict=True):
            forced[:, column] = np.einsum("cq,cqs->cs", weight * drive, mu)  # the sign and the way down cancel
            turned[:, column] = sign * np.einsum("cq,cqs->cs", WEIGHTS * width[:, None] * rate_drive, mu)
        change = np.diff(branch.exponent)
        gain = np.exp(change if rising else -change)
        return Sensitivity(
            _march_rows(gain, forced, rising=rising), np.vstack([np.zeros(5 * sets), np.cumsum(turned, axis=0)])
        )

    def _slopes(self, rate: FloatArray, v: FloatArray) -> FloatArray:
        """Derivative of the blended rate; zero on the shoulders."""
        slopes = np.concatenate([[0.0], np.diff(rate) / np.diff(self.rates.centres), [0.0]])
        return np.asarray(slopes[np.searchsorted(self.rates.centres, v)])

    def _interpolate(
        self, up: Sensitivity, down: Sensitivity, v: FloatArray, rising: np.ndarray
    ) -> tuple[FloatArray, FloatArray]:
        cell = np.clip(np.searchsorted(self.nodes, v, side="right") - 1, 0, len(self.nodes) - 2)
        share = ((v - self.nodes[cell]) / (self.nodes[cell + 1] - self.nodes[cell]))[:, None]
        results = []
        for rise, fall in ((up.target, down.target), (up.exponent, down.exponent)):
            table = np.vstack([fall, rise])
            row = cell + len(self.nodes) * rising
            results.append(table[row] * (1 - share) + table[row + 1] * share)
        return results[0], results[1]


def _march_rows(gain: FloatArray, forced: FloatArray, *, rising: bool) -> FloatArray:
    values = np.zeros((len(gain) + 1, forced.shape[1]))
    cells = range(len(gain)) if rising else range(len(gain) - 1, -1, -1)
    for cell in cells:
        source, sink = (cell, cell + 1) if rising else (cell + 1, cell)
        np.multiply(values[source], gain[cell], out=values[sink])
        values[sink] += forced[cell]
    return values
