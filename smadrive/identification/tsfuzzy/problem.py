"""The least-squares problem behind identify_tsfuzzy: unknowns, residuals and their exact derivatives.

`unknowns.py` describes the vector x of the unknowns. The residuals r(x) are, in this order: the errors of the simulated
output; the differences of the rates from the Duhem fit; the differences of the gaps between the centres from the gaps
at the start; the slopes of the wrong sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy

from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.quality.leave_one_out import leave_one_out_ratio
from smadrive.identification.record import Record
from smadrive.identification.tsfuzzy.monotone import least_slope_derivatives, least_slopes
from smadrive.identification.tsfuzzy.prior import Prior
from smadrive.identification.tsfuzzy.record_reversal import RecordReversals, find_record_reversals
from smadrive.identification.tsfuzzy.sensitivity import LEAST_RATE, RuleRates, RuleTables, Runs, laws_of
from smadrive.identification.tsfuzzy.unknowns import BOTTOM, FIRST_STATE, TOP, Unknowns
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.interpolation_matrix import InterpolationMatrix
from smadrive.numerics.levenberg_marquardt import Minimum, minimise

LEAST_GAP = 0.01  # least distance of two centres, as a share of the input span
_LARGEST_RATE = 300.0
_SPARE_OUTPUT = 0.05  # share of the span by which bottom and top of a model may exceed the known outputs
_STRAY_GAP = 3.0  # unit of the tie between the logits of the gaps and their start (see Prior.reach)


class _Trial(NamedTuple):
    """The variables x of a trial, and what is computed from them.

    `moves` are the derivatives of the centres with respect to the logits of the gaps, (sets, gaps). `tables` are the
    tables of the rules, and `w` are the states at the cells of the record, (cells,).
    """

    x: FloatArray
    moves: FloatArray
    tables: RuleTables
    w: FloatArray


@dataclass(frozen=True, slots=True)
class RuleProblem:
    """The bounded least-squares problem of the rules of a T-S fuzzy Duhem model, for one record.

    `start` is the vector of the unknowns with which the search begins. `monotony` scales the penalty for slopes of the
    wrong sign; 0 allows them. The penalty acts from a branch to the share `depth` of the way to the opposite one.
    """

    record: Record
    runs: Runs
    prior: Prior
    start: FloatArray
    reach: FloatArray
    centres: FloatArray
    fit_centres: bool
    reversals: RecordReversals
    monotony: float = 0.0
    depth: float = 1.0
    _latest: list[_Trial] = field(default_factory=list, init=False)

    @classmethod
    def near(cls, record: Record, prior: Prior, centres: FloatArray, fit_centres: bool) -> RuleProblem:
        """Return the problem whose search starts at the rates of the Duhem fit in `prior`, taken at `centres`."""
        model, (lower, upper) = prior.model, record.input_range
        first = np.clip((record.mean_y[0] - model.offset) / model.scale, 0.0, 1.0)
        tail = [model.offset / record.output_span, (model.offset + model.scale) / record.output_span, float(first)]
        gaps = _gap_logits(centres, lower, upper) if fit_centres else np.empty(0)
        start = np.concatenate([prior.at(centres)[0].ravel(), gaps, tail])
        return cls(
            record,
            Runs(record.v),
            prior,
            start,
            prior.reach(centres),
            centres,
            fit_centres,
            find_record_reversals(record),
        )

    @property
    def unknowns(self) -> Unknowns:
        """The positions of the unknowns in the vector x, as slices."""
        sets = len(self.centres)
        return Unknowns(sets, sets + 1 if self.fit_centres else 0)

    def place(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the centres of the sets (sets,) for the unknowns x, and their derivatives (sets, gaps).

        The derivatives are taken with respect to the logits of the gaps: x holds one logit for each gap between two
        centres or at an end of the range, and their softmax gives the gaps. If the centres are fixed, `gaps` is 0.
        """
        unknowns = self.unknowns
        if not self.fit_centres:
            return self.centres, np.empty((unknowns.sets, 0))
        lower, upper = self.record.input_range
        free = 1 - unknowns.gaps * LEAST_GAP
        share = scipy.special.softmax(x[unknowns.logits])
        centres = lower + (upper - lower) * np.cumsum(LEAST_GAP + free * share)[:-1]
        slope = free * (np.diag(share) - np.outer(share, share))
        return centres, (upper - lower) * np.cumsum(slope, axis=0)[:-1]

    def _trial(self, x: FloatArray) -> _Trial:
        """Return the trial at x.

        The latest trial is kept, because residuals and derivatives are computed at the same x.
        """
        if not (self._latest and np.array_equal(self._latest[0].x, x)):
            centres, moves = self.place(x)
            p_heating, q_heating, p_cooling, q_cooling = self._rates(x)
            rates = RuleRates(p_heating, q_heating, p_cooling, q_cooling, centres)
            tables = RuleTables(rates, *self.record.input_range)
            self._latest[:] = [_Trial(x.copy(), moves, tables, tables.states(self.runs, float(x[FIRST_STATE])))]
        return self._latest[0]

    def _rates(self, x: FloatArray) -> FloatArray:
        lower, upper = self.record.input_range
        return x[self.unknowns.rates].reshape(4, -1) / (upper - lower)

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return the residuals of the unknowns x, (rows,).

        The first rows are the errors of the output at the cells of the record. The next rows are the differences of the
        rates from the Duhem fit, then of the gaps from their start. The last rows are the slopes of the wrong sign.
        """
        record, unknowns = self.record, self.unknowns
        _, _, tables, w = self._trial(x)
        output = x[BOTTOM] + (x[TOP] - x[BOTTOM]) * w
        error = (output - record.mean_y / record.output_span) * np.sqrt(record.count)
        stray = (x[unknowns.rates] - self.prior.at(tables.rates.centres)[0].ravel()) / self.reach
        shift = (x[unknowns.logits] - self.start[unknowns.logits]) / _STRAY_GAP
        if not self.monotony:
            return np.concatenate([error, self.prior.weight * stray, self.prior.weight * shift])
        wrong, weight = self._wrong_slopes(x)
        return np.concatenate([error, self.prior.weight * stray, self.prior.weight * shift, (weight * wrong).ravel()])

    def misfit(self, x: FloatArray) -> float:
        """Return the RMS error of the output that follows from the unknowns x, as a share of the output span."""
        error = self.residuals(x)[: len(self.record.v)]
        return float(np.sqrt(error @ error / self.record.count.sum()))

    def leave_one_out_ratio(self, x: FloatArray) -> float:
        """Return the leave-one-out error divided by the training error, at the minimum x."""
        rates, (low, _) = self.unknowns.rates, self._bounds()
        free = np.ones(len(x), dtype=bool)
        free[rates] = x[rates] > low[rates]
        jacobian = np.vstack([*self.jacobian(x)])[:, free]
        return leave_one_out_ratio(self.residuals(x), jacobian, len(self.record.v), self.record.scatter)

    def _wrong_slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return minus the smallest slopes at the nodes, in 1/(input span), and their weights, both (2, nodes).

        The weight is 0 for a slope of the right sign, and where the output of the record itself reverses.
        """
        tables, (lower, upper) = self._trial(x).tables, self.record.input_range
        missing = -least_slopes(tables, self.depth) * (upper - lower)
        weight = self.monotony * np.sqrt(self.record.count.sum()) * self.prior.slope_tie(tables.nodes)
        return missing, np.where((missing > 0) & ~self.reversals.at(tables.nodes), weight, 0.0)

    def jacobian(self, x: FloatArray) -> Iterator[FloatArray]:
        """Yield the derivatives of the residuals with respect to the unknowns x, in blocks of rows."""
        yield from self._error_derivatives(x).blocks()
        yield self._stray_derivatives(x)
        if self.monotony:
            yield self._wrong_slope_derivatives(x)

    def _error_derivatives(self, x: FloatArray) -> InterpolationMatrix:
        record, unknowns, scale = self.record, self.unknowns, x[TOP] - x[BOTTOM]
        lower, upper = record.input_range
        _, moves, tables, w = self._trial(x)
        dw = tables.jacobian(self.runs, w)
        count = len(dw.rows)
        rows = np.zeros((count + 2, len(x)))
        np.multiply(dw.rows[:, unknowns.rates], scale / (upper - lower), out=rows[:count, unknowns.rates])
        np.matmul(scale * dw.rows[:, unknowns.centres], moves, out=rows[:count, unknowns.logits])
        np.multiply(dw.rows[:, -1], scale, out=rows[:count, FIRST_STATE])
        rows[count, BOTTOM] = rows[count + 1, TOP] = 1.0
        ends = np.broadcast_to(np.array([count, count + 1], dtype=np.int32), (len(w), 2))
        shares = np.column_stack([dw.shares, 1 - w, w]) * np.sqrt(record.count)[:, None]
        return InterpolationMatrix(np.hstack([dw.places, ends]), shares, rows)

    def _stray_derivatives(self, x: FloatArray) -> FloatArray:
        _, moves, tables, _ = self._trial(x)
        unknowns = self.unknowns
        tie = np.zeros((unknowns.logits.stop, len(x)))
        np.fill_diagonal(tie, self.prior.weight / np.concatenate([self.reach, np.full(unknowns.gaps, _STRAY_GAP)]))
        followed = np.vstack([slope[:, None] * moves for slope in self.prior.at(tables.rates.centres)[1]])
        tie[unknowns.rates, unknowns.logits] = -self.prior.weight * followed / self.reach[:, None]
        return tie

    def _wrong_slope_derivatives(self, x: FloatArray) -> FloatArray:
        unknowns, (lower, upper) = self.unknowns, self.record.input_range
        _, moves, tables, _ = self._trial(x)
        derivatives, weight = least_slope_derivatives(tables, self.depth), self._wrong_slopes(x)[1].ravel()
        derivatives = derivatives.reshape(len(weight), -1)
        rows = np.zeros((len(weight), len(x)))
        rows[:, unknowns.rates] = -weight[:, None] * derivatives[:, unknowns.rates]
        rows[:, unknowns.logits] = -weight[:, None] * (upper - lower) * (derivatives[:, unknowns.centres] @ moves)
        return rows

    def solve(self, start: FloatArray, iterations: int, tolerance: float) -> Minimum:
        """Return the minimum that the search from `start` finds within the bounds of the unknowns.

        The search ends after `iterations` steps, or when a step lowers the cost by less than the share `tolerance`.
        """
        bounds = self._bounds()
        return minimise(self.residuals, self.jacobian, start, bounds, iterations=iterations, tolerance=tolerance)

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        unknowns = self.unknowns
        low, high = np.full(len(self.start), -np.inf), np.full(len(self.start), np.inf)
        low[unknowns.rates], high[unknowns.rates] = 0.0, _LARGEST_RATE
        for rates in unknowns.contracting:
            low[rates] = LEAST_RATE
        low[BOTTOM:], high[BOTTOM:] = self._output_bounds()
        return low, high

    def _output_bounds(self) -> tuple[list[float], list[float]]:
        """Return the bounds of bottom, top and first state. Bottom and top stay near the record and the Duhem fit."""
        ends = np.sort(self.start[[BOTTOM, TOP]])
        measured = self.record.mean_y / self.record.output_span
        lowest, highest = min(ends[0], measured.min()), max(ends[1], measured.max())
        spare, middle = _SPARE_OUTPUT * (highest - lowest), 0.5 * (lowest + highest)
        lower_end, upper_end = (lowest - spare, middle), (middle, highest + spare)
        bottom, top = (lower_end, upper_end) if self.start[TOP] > self.start[BOTTOM] else (upper_end, lower_end)
        return [bottom[0], top[0], 0.0], [bottom[1], top[1], 1.0]

    def model(self, x: FloatArray) -> TSFuzzyDuhem:
        """Return the T-S fuzzy Duhem model that the unknowns x describe."""
        sets, record = TriangularSets(tuple(self.place(x)[0].tolist())), self.record
        scale, offset = float(x[TOP] - x[BOTTOM]) * record.output_span, float(x[BOTTOM]) * record.output_span
        return TSFuzzyDuhem.from_laws(sets, *laws_of(*self._rates(x)), scale, offset, record.input_range)

    def first_output(self, x: FloatArray) -> float:
        """Return the output at the first sample, computed from the unknowns x, in the unit of y."""
        return float(x[BOTTOM] + (x[TOP] - x[BOTTOM]) * x[FIRST_STATE]) * self.record.output_span


def _gap_logits(centres: FloatArray, lower: float, upper: float) -> FloatArray:
    """Return the softmax logits of the gaps from `lower` over all centres to `upper`; least gap 1.1 `LEAST_GAP`."""
    gaps = np.diff(np.concatenate([[lower], centres, [upper]])) / (upper - lower)
    return np.log(np.maximum(gaps - LEAST_GAP, 0.1 * LEAST_GAP))
