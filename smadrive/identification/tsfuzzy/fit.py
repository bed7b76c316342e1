"""Identification of a T-S fuzzy Duhem model by its simulated output.

Unknown are the rates p, q ≥ 0 of every rule (see sensitivity), the centres of the sets, scale, offset and first state.
A major loop alone cannot tell a from b, and free least squares then finds rules that expand; here every trial model
contracts and is bounded by construction, its branches run on the right way over the whole range (see monotone) unless
the wire itself turns (see turning), and where the record is silent the rules stay near those of a Duhem fit: each rule
is tied to it about as weakly as one measured sample would tie it, and more tightly where samples do not confirm one
another (see confirmation). The error of the simulated output is minimised, from several placements of the centres, with
exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.quality.fit import Fit, judge
from smadrive.identification.quality.leave_one_out import CONFIRMED
from smadrive.identification.record import Record, prepare
from smadrive.identification.tsfuzzy.monotone import monotone
from smadrive.identification.tsfuzzy.prior import Prior
from smadrive.identification.tsfuzzy.problem import LEAST_GAP, RuleProblem
from smadrive.identification.tsfuzzy.record_reversal import MATERIAL
from smadrive.numerics.levenberg_marquardt import Minimum

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.duhem import DuhemModel
    from smadrive.numerics.arrays import FloatArray

_TRY, _POLISH = (40, 1e-3), (150, 1e-5)  # iterations and relative gain to stop at: for each start, for the best
_CLEARLY_BETTER = 0.8  # RMS of the richer Duhem fit over that of the plainer
_HEAVIER = (10.0, 100.0)  # how much more slopes of the wrong sign may weigh, to be right deep in the loop
_HEAVIEST = (1e3, 1e4)  # and how much if not even the branches are
_DEPTHS = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the loop to which slopes are right, the first that the record bears
_TIES = (3.0, 10.0, 30.0, 100.0)  # how much more tightly the rules may be tied to the Duhem fit
_MOST_COMPONENTS = 3  # Gaussians per branch of that fit
_NOTHING_LEFT = 0.05  # RMS in per cent at which a Duhem fit leaves nothing to explain; or its noise, where that is more
_AS_GOOD = 1.25  # RMS without the last slopes of the wrong sign over RMS with them
_ACTIVITY_SHARES = (0.5, 0.8)  # of a start's centres that go where the output changes, the rest evenly


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
    record does not determine a loop or the sets do not fit it. What it must not be trusted in, its caveats say.
    """
    record = prepare(v, y, dead_band)
    placements = _placements(record, sets, fit_centres=fit_centres)
    prior = Prior(_plainest_duhem(record), record)
    problems = [RuleProblem.near(record, prior, centres, fit_centres) for centres in placements]
    tries = [(problem, problem.solve(problem.start, *_TRY)) for problem in problems]
    problem, best = min(tries, key=lambda pair: pair[1].cost)
    solution = _monotone(*_confirmed(*_polished(problem, best.x)))
    return judge(solution.deepest[0], record, solution.y0)


def _polished(problem: RuleProblem, x: FloatArray) -> tuple[RuleProblem, Minimum]:
    """The solution from x with slopes of the right sign, as deep in the loop as the record bears it."""
    bearable = float(np.hypot(problem.misfit(x), MATERIAL))
    for depth in _DEPTHS:
        problem = replace(problem, monotony=1.0, depth=depth)
        best = problem.solve(x, *_POLISH)
        if problem.misfit(best.x) <= bearable:
            break
    return problem, best


class _Solution:
    """A minimum, and the models that it gives when what is left of slopes of the wrong sign goes."""

    def __init__(self, problem: RuleProblem, x: FloatArray) -> None:
        self.problem, self.x = problem, x
        self.y0, self.misfit = problem.first_output(x), problem.misfit(x)
        self._trimmed: dict[float, tuple[TSFuzzyDuhem, float]] = {}

    @cached_property
    def _model(self) -> TSFuzzyDuhem:
        return self.problem.model(self.x)

    def trimmed(self, depth: float) -> tuple[TSFuzzyDuhem, float]:
        """The model without slopes of the wrong sign to this depth of the loop, and its misfit."""
        if depth not in self._trimmed:
            model = monotone(self._model, depth, self.problem.turning)
            self._trimmed[depth] = model, self.problem.record.misfit(model, self.y0)
        return self._trimmed[depth]

    @cached_property
    def deepest(self) -> tuple[TSFuzzyDuhem, float]:
        """The model trimmed as deep in the loop as that costs little; its branches always."""
        *depths, last = [depth for depth in _DEPTHS if depth <= self.problem.depth]
        bearable = _AS_GOOD * self.misfit
        return self.trimmed(next((depth for depth in depths if self.trimmed(depth)[1] <= bearable), last))


def _monotone(problem: RuleProblem, best: Minimum) -> _Solution:
    """Slopes of the wrong sign weigh more and more, until what is left of them can go at little cost.

    Where more weight costs more than that, the solution that is best without what is left of them.
    """
    tried: list[_Solution] = []
    as_good = _AS_GOOD * problem.misfit(best.x)
    for heavier in (*_HEAVIER, *_HEAVIEST, None):
        solution = _Solution(problem, best.x)
        if solution.trimmed(problem.depth)[1] <= as_good:
            return solution
        tried.append(solution)
        costly = solution.misfit > as_good
        settled = min(one.deepest[1] for one in tried) <= as_good
        if heavier is None or (settled and (costly or heavier in _HEAVIEST)):
            break
        problem = replace(problem, monotony=heavier)
        best = problem.solve(best.x, *_POLISH)
    return min(tried, key=lambda one: one.deepest[1])


def _confirmed(problem: RuleProblem, best: Minimum) -> tuple[RuleProblem, Minimum]:
    """The solution with rules tied so tightly that the samples confirm one another, as far as the record bears it.

    Where no bearable tie does, the one under which they come nearest to it.
    """
    loose, bearable = problem.prior, float(np.hypot(problem.misfit(best.x), MATERIAL))
    tried = [(problem.leave_one_out_ratio(best.x), problem, best)]
    for tie in _TIES:
        if tried[-1][0] <= CONFIRMED:
            break
        problem = replace(problem, prior=loose.tied(tie))
        best = problem.solve(best.x, *_POLISH)
        if problem.misfit(best.x) > bearable:
            break
        tried.append((problem.leave_one_out_ratio(best.x), problem, best))
    return min(tried, key=lambda one: one[0])[1:]


def _plainest_duhem(record: Record) -> Fit[DuhemModel]:
    """As few Gaussians per branch as fit well: more follow noise where the record is silent, or cross there."""
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
    """Centres to start from: those given, evenly over the range, or (when they may move) where the output changes."""
    lower, upper = record.input_range
    if not isinstance(sets, int | np.integer):
        return [_given_centres(sets, lower, upper)]
    most = int(0.5 / LEAST_GAP)
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
    least = LEAST_GAP * (upper - lower)
    inside = len(centres) >= 2 and centres.min() >= lower and centres.max() <= upper
    if not (inside and np.diff(centres).min() >= least):
        raise IdentificationError(
            f"sets = {centres.tolist()}: give at least 2 ascending centres inside the data's range "
            f"[{lower:g}, {upper:g}], {least:g} or more apart"
        )
    return centres
