"""Identification of a T-S fuzzy Duhem model by its simulated output.

Unknown are the rates p, q ≥ 0 of every rule (see sensitivity), the centres of the sets, scale, offset and first state. A
major loop alone cannot tell a from b, and free least squares then finds rules that expand; here every trial model
contracts and is bounded by construction, and where the record is silent the rules stay near those of a Duhem fit: each
rule is tied to it as weakly as one measured sample would tie it. The error of the simulated output is minimised, from
several placements of the centres, with exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import softmax

from smadrive.errors import IdentificationError
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.duhem_fit import fit_duhem
from smadrive.identification.quality import Fit, judge
from smadrive.identification.record import Record, prepare
from smadrive.identification.sensitivity import RuleRates, RuleTables, Runs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.arrays import FloatArray
    from smadrive.hysteresis.duhem import DuhemModel

_LEAST_RATE = 1e-3  # contraction per input span that every rule keeps
_LARGEST_RATE = 1e4
_START_RATE = 300.0
_LEAST_GAP = 0.01  # of the input span, between centres
_TIE_FLOOR = 2e-6  # tie to the Duhem fit for a record without noise, in output spans


def identify_tsfuzzy(
    v: ArrayLike,
    y: ArrayLike,
    sets: int | Sequence[float] = 11,
    *,
    fit_centres: bool = True,
    dead_band: float | None = None,
) -> Fit[TSFuzzyDuhem]:
    """The T-S fuzzy Duhem model with two rules per set that reproduces the record best.

    v, y (samples,): input and output of one wire, preferably with reversals. `sets`: number of triangular sets, or their
    centres; `fit_centres`: whether the centres may move. `dead_band`: radius of the reversal filter in the unit of v,
    None: from the noise of v. Raises DataError for samples that cannot be used, IdentificationError when the record does
    not determine a loop or the sets do not fit it.
    """
    record = prepare(v, y, dead_band)
    placements = _placements(record, sets, fit_centres=fit_centres)
    prior = fit_duhem(record, components=2).model
    problems = [_Problem.near(record, prior, centres, fit_centres) for centres in placements]
    solutions = [(problem, problem.solve()) for problem in problems]
    problem, best = min(solutions, key=lambda pair: float(pair[1].cost))
    return judge(problem.model(best.x), record.path, record.y, problem.first_output(best.x))


def _placements(record: Record, sets: int | Sequence[float], *, fit_centres: bool) -> list[FloatArray]:
    """Centres to start from: those given, or evenly over the range and (when they may move) where the output changes."""
    lower, upper = record.input_range
    if not isinstance(sets, int):
        centres = np.asarray(sets, dtype=np.float64)
        outside = centres[(centres < lower) | (centres > upper)]
        if len(centres) < 2 or outside.size or not (np.diff(centres) > 0).all():
            raise IdentificationError(
                f"sets = {centres.tolist()}: give at least 2 ascending centres inside the data's range [{lower:g}, {upper:g}]"
            )
        return [centres]
    most = int(0.5 / _LEAST_GAP)
    if not 2 <= sets <= most:
        raise IdentificationError(f"sets = {sets}; use 2 to {most}")
    even = np.linspace(lower, upper, sets)
    if not fit_centres:
        return [even]
    moves = np.abs(np.diff(record.mean_y))
    order = np.argsort(record.v[1:])
    placements = []
    for share in (0.5, 0.8):
        activity = np.cumsum(moves[order]) / moves.sum()
        grid = np.linspace(lower, upper, 400)
        blend = share * np.interp(grid, record.v[1:][order], activity, 0, 1) + (1 - share) * (grid - lower) / (upper - lower)
        placements.append(np.interp((np.arange(sets) + 0.5) / sets, blend, grid))
    return [even, *placements]


@dataclass(frozen=True, slots=True)
class _Problem:
    """Bounded least squares over x = (rates · span, gaps of the centres if they move, scale, offset, first state)."""

    record: Record
    runs: Runs
    start: FloatArray
    centres: FloatArray
    fit_centres: bool

    @classmethod
    def near(cls, record: Record, prior: DuhemModel, centres: FloatArray, fit_centres: bool) -> _Problem:
        lower, upper = record.input_range
        span = upper - lower
        rates = []
        for rising in (True, False):
            a, b = prior.local_laws(np.clip(centres, prior.engine.lower, prior.engine.upper), rising=rising)
            total = np.minimum(np.abs(a) * span, _START_RATE)
            share = np.clip(b / -a, 0.0, 1.0)
            rates += [total * share, total * (1 - share)]
        tail = np.array([prior.scale / record.output_span, prior.offset / record.output_span, 0.0])
        tail[2] = np.clip((record.mean_y[0] - prior.offset) / prior.scale, 0.0, 1.0)
        gaps = _gap_logits(centres, lower, upper) if fit_centres else np.empty(0)
        return cls(record, Runs(record.v), np.concatenate([*rates, gaps, tail]), centres, fit_centres)

    def place(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centres and their derivative with respect to the gaps' logits."""
        sets = len(self.centres)
        if not self.fit_centres:
            return self.centres, np.empty((sets, 0))
        lower, upper = self.record.input_range
        free = 1 - (sets + 1) * _LEAST_GAP
        share = softmax(x[4 * sets : 5 * sets + 1])
        centres = lower + (upper - lower) * np.cumsum(_LEAST_GAP + free * share)[:-1]
        slope = free * (np.diag(share) - np.outer(share, share))
        return centres, (upper - lower) * np.cumsum(slope, axis=0)[:-1]

    def tables(self, x: FloatArray) -> RuleTables:
        lower, upper = self.record.input_range
        return RuleTables(RuleRates(*self._rates(x), self.place(x)[0]), lower, upper)

    def _rates(self, x: FloatArray) -> FloatArray:
        lower, upper = self.record.input_range
        return x[: 4 * len(self.centres)].reshape(4, -1) / (upper - lower)

    def _tie(self) -> tuple[FloatArray, float]:
        """How far each variable may stray from the start, and the weight of the tie."""
        sets = len(self.centres)
        reach = np.full(len(self.start), 3.0)
        reach[: 4 * sets] = self.start[: 4 * sets] + 10.0
        reach[-3:] = 1e3
        return reach, max(self.record.noise, _TIE_FLOOR)

    def residuals(self, x: FloatArray) -> FloatArray:
        record = self.record
        w = self.tables(x).states(self.runs, float(x[-1]))
        error = (x[-2] + x[-3] * w - record.mean_y / record.output_span) * np.sqrt(record.count)
        reach, weight = self._tie()
        return np.concatenate([error, weight * (x - self.start) / reach])

    def jacobian(self, x: FloatArray) -> FloatArray:
        record, sets = self.record, len(self.centres)
        lower, upper = record.input_range
        tables = self.tables(x)
        w = tables.states(self.runs, float(x[-1]))
        dw = tables.jacobian(self.runs, float(x[-1]))
        rates = x[-3] * dw[:, : 4 * sets] / (upper - lower)
        gaps = x[-3] * dw[:, 4 * sets : 5 * sets] @ self.place(x)[1]
        columns = np.column_stack([rates, gaps, w, np.ones_like(w), x[-3] * dw[:, -1]])
        reach, weight = self._tie()
        return np.vstack([columns * np.sqrt(record.count)[:, None], np.diag(weight / reach)])

    def solve(self) -> OptimizeResult:
        sets = len(self.centres)
        low = np.full(len(self.start), -np.inf)
        high = np.full(len(self.start), np.inf)
        low[: 4 * sets], high[: 4 * sets] = 0.0, _LARGEST_RATE
        low[:sets] = low[3 * sets : 4 * sets] = _LEAST_RATE
        low[-1], high[-1] = 0.0, 1.0
        start = np.clip(self.start, low, high)
        return least_squares(self.residuals, start, self.jacobian, bounds=(low, high), x_scale="jac", ftol=1e-5, xtol=1e-6, max_nfev=100)

    def model(self, x: FloatArray) -> TSFuzzyDuhem:
        p_heating, q_heating, p_cooling, q_cooling = self._rates(x)
        return TSFuzzyDuhem(
            TriangularSets(tuple(self.place(x)[0].tolist())),
            a_heating=-(p_heating + q_heating),
            b_heating=p_heating,
            a_cooling=p_cooling + q_cooling,
            b_cooling=-p_cooling,
            scale=float(x[-3]) * self.record.output_span,
            offset=float(x[-2]) * self.record.output_span,
            input_range=self.record.input_range,
        )

    def first_output(self, x: FloatArray) -> float:
        return float(x[-2] + x[-3] * x[-1]) * self.record.output_span


def _gap_logits(centres: FloatArray, lower: float, upper: float) -> FloatArray:
    """The softmax logits of the gaps lower-c1, c1-c2, ..., cn-upper, each at least a little above the least gap."""
    gaps = np.diff(np.concatenate([[lower], centres, [upper]])) / (upper - lower)
    return np.log(np.maximum(gaps - _LEAST_GAP, 0.1 * _LEAST_GAP))
