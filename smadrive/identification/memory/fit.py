"""The choice of a model with or without memory, by loops of the record that are held out of the fit.

There are three candidates: rules without memory, a Preisach plane alone, and both in parallel. Each is fitted twice,
and each time another third of the loops is held out. The inputs of held-out loops stay in the path, because the state
of the wire depends on the whole path, but their outputs count for nothing in the errors that a fit reduces. Only the
places of sets and thresholds, and the start of the fit, also follow from the outputs of held-out loops. Memory must
reduce the error on these loops clearly, because a plane has hundreds of masses. Rules and plane in parallel must also
explain the whole record much better than the plane alone, because few loops do not tell the two parts apart.

A one-sided record has no heating curve that begins inside the loop. On such a record the plane may have a larger
error than the rules, because measured wires nearly return to their turning points (return-point memory, Mayergoyz
1986).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from math import nan, sqrt
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis import TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.memory.candidates import (
    TURNING_POINT_SETS,
    FitRules,
    Model,
    check_memory,
    plane_alone,
    rules_and_plane,
)
from smadrive.identification.quality.metrics import Fit, judge
from smadrive.identification.record import Record, prepare
from smadrive.identification.tsfuzzy.fit import FUZZY_SETS, fit_rules

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

THIRDS = (1, 2)
"""Loop n belongs to the third n % 3. These thirds are held out in turn; third 0 is not, as it has the major loop."""

LEAST_LOOPS = 6
"""Smallest number of loops from which the memory of a wire can be judged."""

Candidate = Callable[[Record], tuple[Model, float]]
"""A function that fits a candidate to a record. It returns the model with its output at the first sample."""

_MEMORY_PAYS = 0.8  # largest held-out error with memory, as a share of that without
_HOPELESS = 4.0  # the rules are chosen if the plane's error on the whole record exceeds their error by this factor
_BOTH_FIT = 0.6  # largest error of rules and plane on the whole record, as a share of that of the plane alone
_BOTH_PREDICT = 0.9  # largest held-out error of rules and plane, as a share of that of the plane alone
_ONE_SIDED_PAYS = 2.5  # largest held-out error with memory on a one-sided record, as a share of that without
_INSIDE = 0.1  # of the output span: a heating curve that begins further from the cold end begins inside the loop
_ONE_SIDED = (
    "every heating curve of the record begins at the cold end, so the model assumes that the wire returns to all its "
    "turning points: record heating curves inside the loop, too"
)
_UNSEEN = 1e-6  # weight of a sample that is held out

NOTHING_LEFT = 0.2
"""Rules with at most this RMS error, % of the output span, explain the record without memory.

If the noise of the output is larger, the noise is the limit.
"""


def identify_memory(
    v: ArrayLike, y: ArrayLike, sets: int = FUZZY_SETS, *, memory: int | None = None, dead_band: float | None = None
) -> MemoryFit:
    """Fit T-S fuzzy rules to a record, with a Preisach plane if the wire remembers its turning points.

    v and y are input and output of one wire, both (samples,). `sets` is the number of fuzzy sets of the rules. `memory`
    is the number of sets of the last turning point: 4 to 40 for a model with memory, 1 for a model without memory. None
    lets the record decide, by loops that are held out of the fit. `dead_band` is the radius of the reversal filter in
    the unit of v; without `dead_band` the radius follows from the noise of v. Raises the errors of identify_tsfuzzy,
    and IdentificationError for another value of `memory`.
    """
    if memory is not None:
        check_memory(memory, IdentificationError)
    record = prepare(v, y, dead_band)

    def fit_these(one: Record) -> tuple[TSFuzzyDuhem, float]:
        return fit_rules(one, sets)

    if memory is None:
        model, y0, choice = _chosen(record, fit_these)
    elif memory == 1:
        (model, y0), choice = fit_these(record), MemoryChoice(1, nan, nan)
    else:
        model, y0, choice = with_memory(record, memory, fit_these)
    fit = judge(model, record, y0)
    figures = {field.name: getattr(fit, field.name) for field in fields(fit)}
    return MemoryFit(**figures | {"caveats": (*fit.caveats, *choice.caveats)}, memory=choice)


def _chosen(record: Record, fit_these: FitRules) -> tuple[Model, float, MemoryChoice]:
    """Return the rules alone if they explain the record; otherwise the model that held-out loops prefer."""
    rules = fit_these(record)
    misfit = 100 * record.misfit(*rules)
    explained = misfit <= max(NOTHING_LEFT, 100 * record.noise)
    if _has_too_few_loops(record):
        return *rules, MemoryChoice(1, nan, nan, () if explained else (_too_few_loops(record, misfit),))
    if explained and _shows_heating_inside(record):
        return *rules, MemoryChoice(1, nan, nan)
    return choose(record, TURNING_POINT_SETS[1], fit_these, rules)


def _has_too_few_loops(record: Record) -> bool:
    return int(loops_of(record)[-1]) + 1 < LEAST_LOOPS


def _too_few_loops(record: Record, misfit_percent: float) -> str:
    loops = int(loops_of(record)[-1]) + 1
    return (
        f"the fit leaves {misfit_percent:.2g} % RMS, and the record has {loops} of the {LEAST_LOOPS} loops that are "
        "needed to tell whether the wire remembers its turning points: record more inner loops"
    )


@dataclass(frozen=True, slots=True)
class MemoryChoice:
    """How the memory of a model was chosen.

    `sets` is the number of sets of the last turning point; 1 is no memory. `with_percent` and `without_percent` are the
    RMS errors with and without memory on the held-out loops, in % of the output span. They are NaN if the number of
    sets was given, if the record has too few loops, if rules alone explain the record, and if a plane alone explains
    the record much worse than rules. `caveats` are reasons to distrust the choice.
    """

    sets: int
    with_percent: float
    without_percent: float
    caveats: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class MemoryFit(Fit[Model]):
    """An identified T-S fuzzy model with or without memory, its metrics, and how its memory was chosen."""

    memory: MemoryChoice


def loops_of(record: Record) -> np.ndarray:
    """Return the number of the loop to which each cell of the record belongs, (cells,), counted from 0.

    A loop is two monotone sections of the input.
    """
    rising = record.rising
    turned = np.concatenate([[False], rising[1:] != rising[:-1]])
    return np.asarray(np.cumsum(turned) // 2)


def choose(
    record: Record, sets: int, fit_rules: FitRules, rules: tuple[TSFuzzyDuhem, float]
) -> tuple[Model, float, MemoryChoice]:
    """Return the chosen model, its output at the first sample, and how it was chosen.

    The candidates are rules, a Preisach plane, and both in parallel. A candidate with memory must be clearly better
    than the rules (but see `_ONE_SIDED_PAYS`), and both in parallel must be clearly better than the plane. `sets` is
    the number of sets of the last turning point of the candidates with memory. `fit_rules` fits the rules, and `rules`
    is the result of `fit_rules` for the whole record.
    """
    fit_plane, fit_both = _candidates(record, sets, fit_rules)
    plane = fit_plane(record)
    if record.misfit(*plane) > _HOPELESS * record.misfit(*rules):
        return *rules, MemoryChoice(1, nan, nan)
    (model, y0), held_out, caveats = _better(record, plane, fit_plane, fit_both)
    without = _held_out(record, fit_rules)
    if held_out >= (_ONE_SIDED_PAYS if caveats else _MEMORY_PAYS) * without:
        return *rules, MemoryChoice(1, held_out, without)
    return model, y0, MemoryChoice(_sets_of(model, sets), held_out, without, caveats)


def with_memory(record: Record, sets: int, fit_rules: FitRules) -> tuple[Model, float, MemoryChoice]:
    """Return the better model with memory, its output at the first sample, and how it was chosen.

    `sets` is the number of sets of the last turning point; `fit_rules` fits the rules. A record with too few loops for
    a comparison gets the plane alone.
    """
    fit_plane, fit_both = _candidates(record, sets, fit_rules)
    if _has_too_few_loops(record):
        model, y0 = fit_plane(record)
        misfit = 100 * record.misfit(model, y0)
        return model, y0, MemoryChoice(_sets_of(model, sets), nan, nan, (_too_few_loops(record, misfit),))
    (model, y0), _, caveats = _better(record, fit_plane(record), fit_plane, fit_both)
    return model, y0, MemoryChoice(_sets_of(model, sets), nan, nan, caveats)


def _candidates(record: Record, sets: int, fit_rules: FitRules) -> tuple[Candidate, Candidate]:
    """Return the two candidates with memory: the plane alone, and rules and plane."""
    duhem = fit_duhem(record, components=1).model
    return (
        partial(plane_alone, sets=sets, duhem=duhem),
        partial(rules_and_plane, sets=sets, duhem=duhem, fit_rules=fit_rules),
    )


def _better(
    record: Record, plane: tuple[Model, float], fit_plane: Candidate, fit_both: Candidate
) -> tuple[tuple[Model, float], float, tuple[str, ...]]:
    """Return the better fitted candidate with memory, its held-out error in % of the output span, and its caveats.

    `plane` is the result of `fit_plane` for the whole record. On a one-sided record the result is the plane.
    """
    held_out = _held_out(record, fit_plane)
    if not _shows_heating_inside(record):
        return plane, held_out, (_ONE_SIDED,)
    both = fit_both(record)
    if record.misfit(*both) < _BOTH_FIT * record.misfit(*plane):
        both_held_out = _held_out(record, fit_both)
        if both_held_out < _BOTH_PREDICT * held_out:
            return both, both_held_out, ()
    return plane, held_out, ()


def _sets_of(model: Model, sets: int) -> int:
    """Return the number of sets of the last turning point: 1 if the fit found no memory."""
    return sets if isinstance(model, TSFuzzyPreisach) else 1


def _shows_heating_inside(record: Record) -> bool:
    """Return True if a heating curve of the record begins inside the loop.

    If every heating curve begins at the cold end, the record is one-sided. Rules then predict the same falling curves
    as a plane whose up- and down-thresholds are independent, so the division between rules and plane is undetermined.
    """
    rises, cold_y = np.diff(record.v) > 0, record.mean_y[np.argmin(record.v)]
    begins = np.flatnonzero(rises[1:] & ~rises[:-1]) + 1
    return bool((np.abs(record.mean_y[begins] - cold_y) > _INSIDE * record.output_span).any())


def _held_out(record: Record, fit: Candidate) -> float:
    """Return the RMS error of a candidate on the loops that were hidden from its fit, % of the output span."""
    loops, squares, samples = loops_of(record), 0.0, 0.0
    for third in THIRDS:
        hidden = loops % 3 == third
        model, y0 = fit(replace(record, count=np.where(hidden, _UNSEEN, record.count)))
        error = (model.simulate(record.v, y0) - record.mean_y)[hidden] / record.output_span
        squares += float(record.count[hidden] @ error**2)
        samples += float(record.count[hidden].sum())
    return 100 * sqrt(squares / samples)
