"""Identification of a T-S fuzzy Duhem model by its simulated output.

The unknowns are two rates p, q ≥ 0 of every rule (see sensitivity.py), the centres of the sets, scale, offset and first
state. A major loop alone does not determine both consequents a and b of a rule. A fit without further conditions then
finds rules with which two states at the same input move apart. Here every trial model contracts and is bounded by
construction. The slopes of the branches of the result have the right sign over the whole range (see monotone.py),
except where the wire itself reverses (see record_reversal.py).

Where the record has no samples, the rules stay near the local laws of a Duhem fit. A tie pulls each rule towards the
Duhem fit with the weight of about one measured sample. The tie becomes tighter if that makes the leave-one-out error
smaller, or if the rules follow single samples (see quality/leave_one_out.py). The fit minimises the error of the
simulated output with exact derivatives. It starts from several placements of the centres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.quality.leave_one_out import cautious_error
from smadrive.identification.quality.metrics import Fit, judge
from smadrive.identification.record import Record, prepare
from smadrive.identification.tsfuzzy.monotone import monotone
from smadrive.identification.tsfuzzy.prior import Prior
from smadrive.identification.tsfuzzy.problem import LEAST_GAP, RuleProblem
from smadrive.identification.tsfuzzy.record_reversal import MATERIAL
from smadrive.numerics.arrays import float_array
from smadrive.numerics.scalars import whole_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.duhem import DuhemModel
    from smadrive.numerics.arrays import FloatArray

_TRY, _POLISH = (40, 1e-3), (150, 1e-5)  # iterations and relative gain to stop at: for each start, for the best
_CLEARLY_BETTER = 0.8  # largest RMS of a better Duhem fit with one more Gaussian, as a share of the RMS without it
_HEAVIER = (10.0, 100.0)  # weights of slopes of the wrong sign inside the loop
_HEAVIEST = (1e3, 1e4)  # weights if even the slopes of the branches have the wrong sign
_DEPTHS = (1.0, 0.75, 0.5, 0.25, 0.0)  # see monotone.py; the first depth that raises the misfit little is used
_TIES = (3.0, 10.0, 30.0, 100.0)  # factors by which the tie of the rules to the Duhem fit may tighten
FUZZY_SETS = 11
"""The standard number of fuzzy sets."""

_MOST_COMPONENTS = 3  # Gaussians per branch of the Duhem fit
_NOTHING_LEFT = 0.05  # RMS in % at which a Duhem fit leaves nothing to explain; or the noise, if it is larger
_AS_GOOD = 1.25  # largest RMS after removing the last slopes of the wrong sign, over RMS before
_ACTIVITY_SHARES = (0.5, 0.8)  # share of the centres that start where the output changes; the others are evenly spaced


def identify_tsfuzzy(
    v: ArrayLike,
    y: ArrayLike,
    sets: int | Sequence[float] = FUZZY_SETS,
    *,
    fit_centres: bool = True,
    dead_band: float | None = None,
) -> Fit[TSFuzzyDuhem]:
    """Fit a T-S fuzzy Duhem model with two rules per set to a record, and return the model with its metrics.

    v and y are input and output of one wire, both (samples,); the record should contain inner loops. `sets` is the
    number of triangular sets, or their centres. With `fit_centres` the fit may move the centres. `dead_band` is the
    radius of the reversal filter in the unit of v; without `dead_band` the radius follows from the noise of v.
    DataError for samples that cannot be used, and IdentificationError when the record does not determine a loop or when
    the sets are unusable.
    """
    record = prepare(v, y, dead_band)
    model, y0 = fit_rules(record, sets, fit_centres=fit_centres)
    return judge(model, record, y0)


def fit_rules(
    record: Record, sets: int | Sequence[float] = FUZZY_SETS, *, fit_centres: bool = True
) -> tuple[TSFuzzyDuhem, float]:
    """Fit rules without memory to a prepared record. Return the model, and its output at the first sample."""
    placements = _placements(record, sets, fit_centres=fit_centres)
    prior = Prior(_plainest_duhem(record), record)
    problems = [RuleProblem.near(record, prior, centres, fit_centres) for centres in placements]
    tries = [(problem, problem.solve(problem.start, *_TRY)) for problem in problems]
    problem, best = min(tries, key=lambda pair: pair[1].cost)
    solution = _monotone(_validated(_polished(_Solution(problem, best.x))))
    return solution.deepest[0], solution.y0


class _Solution:
    """A minimum x of a problem, its fitted model, and its trimmed models, which have no slopes of the wrong sign."""

    def __init__(self, problem: RuleProblem, x: FloatArray) -> None:
        self.problem, self.x = problem, x
        self.y0, self.misfit = problem.first_output(x), problem.misfit(x)
        self._trimmed: dict[float, tuple[TSFuzzyDuhem, float]] = {}

    def again(self, problem: RuleProblem) -> _Solution:
        """Return the solution of a modified problem, started from this solution."""
        return _Solution(problem, problem.solve(self.x, *_POLISH).x)

    @cached_property
    def cautious_error(self) -> float:
        """The leave-one-out error by which solutions are compared, RMS, as a share of the output span."""
        return cautious_error(self.misfit, self.problem.leave_one_out_ratio(self.x))

    @cached_property
    def _model(self) -> TSFuzzyDuhem:
        return self.problem.model(self.x)

    def trimmed(self, depth: float) -> tuple[TSFuzzyDuhem, float]:
        """Return the trimmed model, whose slopes have the right sign to this `depth` of the loop, and its misfit."""
        if depth not in self._trimmed:
            model = monotone(self._model, depth, self.problem.reversals)
            self._trimmed[depth] = model, self.problem.record.misfit(model, self.y0)
        return self._trimmed[depth]

    @cached_property
    def deepest(self) -> tuple[TSFuzzyDuhem, float]:
        """The trimmed model and its misfit, at the greatest depth at which the misfit hardly rises.

        The misfit may rise by at most the factor `_AS_GOOD`. If no depth fulfils this, the depth is 0.
        """
        *depths, last = [depth for depth in _DEPTHS if depth <= self.problem.depth]
        bearable = _AS_GOOD * self.misfit
        return self.trimmed(next((depth for depth in depths if self.trimmed(depth)[1] <= bearable), last))


def _polished(start: _Solution) -> _Solution:
    """Return the solution with a penalty on wrong slopes to the greatest depth at which the misfit stays small."""
    bearable, solution = float(np.hypot(start.misfit, MATERIAL)), start
    for depth in _DEPTHS:
        solution = start.again(replace(start.problem, monotony=1.0, depth=depth))
        if solution.misfit <= bearable:
            break
    return solution


def _validated(solution: _Solution) -> _Solution:
    """Return the solution with the smallest leave-one-out error, of several ties to the Duhem fit.

    Only solutions with a small misfit count.
    """
    bearable, tried = float(np.hypot(solution.misfit, MATERIAL)), []
    for tied in _ever_tighter(solution):
        if tied.misfit > bearable:
            break
        tried.append(tied)
        bearable = min(bearable, tied.cautious_error)  # no solution with a larger misfit has a smaller error
    return min(tried, key=lambda one: one.cautious_error)


def _ever_tighter(solution: _Solution) -> Iterator[_Solution]:
    """Yield the solution, then solutions with tighter and tighter ties to the Duhem fit."""
    loose = solution.problem.prior
    yield solution
    for tie in _TIES:
        solution = solution.again(replace(solution.problem, prior=loose.tied(tie)))
        yield solution


def _monotone(solution: _Solution) -> _Solution:
    """Return the solution with the smallest penalty on wrong slopes whose trimmed model still has a small misfit.

    If larger penalties themselves make the misfit large, return the solution with the smallest misfit of its trimmed
    model.
    """
    as_good, tried = _AS_GOOD * solution.misfit, []
    for weighted in _ever_heavier(solution):
        if weighted.trimmed(weighted.problem.depth)[1] <= as_good:
            return weighted
        tried.append(weighted)
        is_costly = weighted.misfit > as_good or weighted.problem.monotony >= _HEAVIER[-1]
        if is_costly and min(one.deepest[1] for one in tried) <= as_good:
            break
    return min(tried, key=lambda one: one.deepest[1])


def _ever_heavier(solution: _Solution) -> Iterator[_Solution]:
    """Yield the solution, then solutions with larger and larger penalties on slopes of the wrong sign."""
    yield solution
    for weight in (*_HEAVIER, *_HEAVIEST):
        solution = solution.again(replace(solution.problem, monotony=weight))
        yield solution


def _plainest_duhem(record: Record) -> Fit[DuhemModel]:
    """Return the Duhem fit with the fewest Gaussians per branch that is good enough.

    More Gaussians would follow the noise.
    """
    plain = fit_duhem(record, components=1)
    nothing_left = max(_NOTHING_LEFT, 100 * record.noise / _CLEARLY_BETTER)
    for components in range(2, _MOST_COMPONENTS + 1):
        if plain.rms_percent <= nothing_left:
            break
        try:
            rich = fit_duhem(record, components)
        except IdentificationError:
            break
        if rich.rms_percent > _CLEARLY_BETTER * plain.rms_percent:
            break
        plain = rich
    return plain


def _placements(record: Record, sets: int | Sequence[float], *, fit_centres: bool) -> list[FloatArray]:
    """Return the centres from which the fits start, one array per fit.

    Given centres are returned as they are. If `sets` is a number, fixed centres are evenly spaced, and centres that may
    move lie closer together where the output changes most.
    """
    lower, upper = record.input_range
    if not np.isscalar(sets):
        return [_given_centres(sets, lower, upper)]
    most = int(0.5 / LEAST_GAP)
    sets = whole_number(sets, "sets", "fuzzy sets", 2, most, IdentificationError)
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


def _given_centres(sets: ArrayLike, lower: float, upper: float) -> FloatArray:
    centres = float_array("sets", sets)
    least = LEAST_GAP * (upper - lower)
    inside = len(centres) >= 2 and centres.min() >= lower and centres.max() <= upper
    if not (inside and np.diff(centres).min() >= least):
        cure = f"give at least 2 ascending centres, {least:g} or more apart"
        limit = f"{lower:g} to {upper:g}"
        raise IdentificationError("unusable centres", where="sets", value=centres.tolist(), limit=limit, cure=cure)
    return centres
