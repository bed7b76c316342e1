"""Identification of a T-S fuzzy Duhem model by its simulated output.

Unknown are the rates p, q ≥ 0 of every rule (see sensitivity), the centres of the sets, scale, offset and first state.
A major loop alone cannot tell a from b, and free least squares then finds rules that expand; here every trial model
contracts and is bounded by construction, and where the record is silent the rules stay near those of a Duhem fit: each
rule is tied to it about as weakly as one measured sample would tie it. The error of the simulated output is minimised,
from several placements of the centres, with exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import softmax

from smadrive.errors import IdentificationError
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.bounded import Minimum, minimise
from smadrive.identification.duhem_fit import fit_duhem
from smadrive.identification.quality import Fit, judge
from smadrive.identification.record import Record, prepare
from smadrive.identification.sensitivity import RuleRates, RuleTables, Runs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.arrays import FloatArray
    from smadrive.hysteresis.duhem import DuhemModel

_LEAST_RATE = 1e-3  # contraction per input span that every rule keeps
_LARGEST_RATE = 300.0
_TRY, _POLISH = (40, 1e-3), (150, 1e-5)  # iterations and relative gain to stop at: for each start, for the best
_LARGEST_PRIOR = 200.0
_LEAST_GAP = 0.01  # of the input span, between centres
_PRIOR_CELLS = 400
_STRAY, _STRAY_LEAST = 0.3, 0.5  # rates may stray from the Duhem fit's by this share of p + q, and this per input span
_STRAY_GAP = 3.0  # the same for the logarithms of the gaps between centres
_CLEARLY_BETTER = 0.8  # RMS of the richer Duhem fit over that of the plainer
_ACTIVITY_SHARES = (0.5, 0.8)  # of a start's centres that go where the output changes, the rest evenly
_TIE_MISFIT = 0.2  # a Duhem fit's own misfit, in these units, counts like noise
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

    v, y (samples,): input and output of one wire, preferably with reversals. `sets`: number of triangular sets, or
    their centres; `fit_centres`: whether the centres may move. `dead_band`: radius of the reversal filter in the unit
    of v, None: from the noise of v. Raises DataError for samples that cannot be used, IdentificationError when the
    record does not determine a loop or the sets do not fit it.
    """
    record = prepare(v, y, dead_band)
    placements = _placements(record, sets, fit_centres=fit_centres)
    prior = _Prior(_plainest_duhem(record), record)
    problems = [_Problem.near(record, prior, centres, fit_centres) for centres in placements]
    tries = [(problem, problem.solve(problem.start, *_TRY)) for problem in problems]
    problem, best = min(tries, key=lambda pair: pair[1].cost)
    best = problem.solve(best.x, *_POLISH)
    return judge(problem.model(best.x), record.path, record.y, problem.first_output(best.x))


def _plainest_duhem(record: Record) -> Fit[DuhemModel]:
    """One Gaussian per branch, or two where they fit clearly better: more follow noise where the record is silent."""
    plain, rich = fit_duhem(record, components=1), fit_duhem(record, components=2)
    return rich if rich.rms_percent < _CLEARLY_BETTER * plain.rms_percent else plain


def _placements(record: Record, sets: int | Sequence[float], *, fit_centres: bool) -> list[FloatArray]:
    """Centres to start from: those given, evenly over the range, or (when they may move) where the output changes."""
    lower, upper = record.input_range
    if not isinstance(sets, int | np.integer):
        return [_given_centres(sets, lower, upper)]
    most = int(0.5 / _LEAST_GAP)
    if not 2 <= sets <= most:
        raise IdentificationError(f"sets = {sets}; use 2 to {most}")
    if not fit_centres:
        return [np.linspace(lower, upper, sets)]
    order = np.argsort(record.v[1:])
    places = (record.v[1:][order] - lower) / (upper - lower)
    moved = np.cumsum(np.abs(np.diff(record.mean_y))[order])
    grid = np.linspace(0.0, 1.0, 401)
    activity = np.interp(grid, places, moved / moved[-1], 0, 1)
    middles = (np.arange(sets) + 0.5) / sets
    shares = [np.interp(middles, share * activity + (1 - share) * grid, grid) for share in _ACTIVITY_SHARES]
    return [lower + (upper - lower) * share for share in shares]


def _given_centres(sets: Sequence[float], lower: float, upper: float) -> FloatArray:
    centres = np.asarray(sets, dtype=np.float64)
    least = _LEAST_GAP * (upper - lower)
    inside = len(centres) >= 2 and centres.min() >= lower and centres.max() <= upper
    if not (inside and np.diff(centres).min() >= least):
        raise IdentificationError(
            f"sets = {centres.tolist()}: give at least 2 ascending centres inside the data's range "
            f"[{lower:g}, {upper:g}], {least:g} or more apart"
        )
    return centres


class _Prior:
    """The rates p and q of a Duhem model as functions of v, tabulated; in units of one per input span."""

    def __init__(self, fit: Fit[DuhemModel], record: Record) -> None:
        lower, upper = record.input_range
        model = fit.model
        self.model = model
        self.grid = np.linspace(lower, upper, _PRIOR_CELLS + 1)
        inside = np.clip(self.grid, model.engine.lower, model.engine.upper)
        rates = []
        for rising in (True, False):
            a, b = model.local_laws(inside, rising=rising)
            total = np.minimum(np.abs(a) * (upper - lower), _LARGEST_PRIOR)
            share = np.clip(b / -a, 0.0, 1.0)
            rates += [total * share, total * (1 - share)]
        self.rates = np.array(rates)
        self._slopes = np.gradient(self.rates, self.grid, axis=1)
        self.weight = max(record.noise, _TIE_MISFIT * fit.rms_percent / 100, _TIE_FLOOR)

    def at(self, centres: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates (4, sets) and their derivatives with respect to v."""
        return _interpolate(centres, self.grid, self.rates), _interpolate(centres, self.grid, self._slopes)

    def reach(self, centres: FloatArray) -> FloatArray:
        """How far rates (4, sets) may stray before it costs as much as one sample off by the noise."""
        pairs = _interpolate(centres, self.grid, self.rates).reshape(2, 2, -1)
        return np.ravel(np.broadcast_to(_STRAY * pairs.sum(axis=1, keepdims=True) + _STRAY_LEAST, pairs.shape))


def _interpolate(v: FloatArray, grid: FloatArray, rows: FloatArray) -> FloatArray:
    return np.array([np.interp(v, grid, row) for row in rows])


@dataclass(frozen=True, slots=True)
class _Problem:
    """Bounded least squares over x = (rates · span, gaps of the centres if they move, scale, offset, first state)."""

    record: Record
    runs: Runs
    prior: _Prior
    start: FloatArray
    reach: FloatArray
    centres: FloatArray
    fit_centres: bool

    @classmethod
    def near(cls, record: Record, prior: _Prior, centres: FloatArray, fit_centres: bool) -> _Problem:
        model, (lower, upper) = prior.model, record.input_range
        first = np.clip((record.mean_y[0] - model.offset) / model.scale, 0.0, 1.0)
        tail = [model.scale / record.output_span, model.offset / record.output_span, float(first)]
        gaps = _gap_logits(centres, lower, upper) if fit_centres else np.empty(0)
        start = np.concatenate([prior.at(centres)[0].ravel(), gaps, tail])
        return cls(record, Runs(record.v), prior, start, prior.reach(centres), centres, fit_centres)

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
        p_heating, q_heating, p_cooling, q_cooling = self._rates(x)
        rates = RuleRates(p_heating, q_heating, p_cooling, q_cooling, self.place(x)[0])
        return RuleTables(rates, lower, upper)

    def _rates(self, x: FloatArray) -> FloatArray:
        lower, upper = self.record.input_range
        return x[: 4 * len(self.centres)].reshape(4, -1) / (upper - lower)

    def residuals(self, x: FloatArray) -> FloatArray:
        record, rates = self.record, 4 * len(self.centres)
        w = self.tables(x).states(self.runs, float(x[-1]))
        error = (x[-2] + x[-3] * w - record.mean_y / record.output_span) * np.sqrt(record.count)
        stray = (x[:rates] - self.prior.at(self.place(x)[0])[0].ravel()) / self.reach
        shift = (x[rates:-3] - self.start[rates:-3]) / _STRAY_GAP
        return np.concatenate([error, self.prior.weight * stray, self.prior.weight * shift])

    def jacobian(self, x: FloatArray) -> FloatArray:
        record, sets = self.record, len(self.centres)
        lower, upper = record.input_range
        tables = self.tables(x)
        w = tables.states(self.runs, float(x[-1]))
        dw = tables.jacobian(self.runs, float(x[-1]))
        centres, moves = self.place(x)
        rates = x[-3] * dw[:, : 4 * sets] / (upper - lower)
        gaps = x[-3] * dw[:, 4 * sets : 5 * sets] @ moves
        error = np.column_stack([rates, gaps, w, np.ones_like(w), x[-3] * dw[:, -1]]) * np.sqrt(record.count)[:, None]
        slopes = self.prior.at(centres)[1]
        tie = np.zeros((4 * sets + moves.shape[1], len(x)))
        np.fill_diagonal(tie, self.prior.weight / np.concatenate([self.reach, np.full(moves.shape[1], _STRAY_GAP)]))
        followed = np.vstack([slope[:, None] * moves for slope in slopes])
        tie[: 4 * sets, 4 * sets : -3] = -self.prior.weight * followed / self.reach[:, None]
        return np.vstack([error, tie])

    def solve(self, start: FloatArray, iterations: int, tolerance: float) -> Minimum:
        sets = len(self.centres)
        low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
        low[: 4 * sets], high[: 4 * sets] = 0.0, _LARGEST_RATE
        low[:sets] = low[3 * sets : 4 * sets] = _LEAST_RATE
        low[-1], high[-1] = 0.0, 1.0
        bounds = (low, high)
        return minimise(self.residuals, self.jacobian, start, bounds, iterations=iterations, tolerance=tolerance)

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
