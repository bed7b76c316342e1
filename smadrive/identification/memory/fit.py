"""How much memory a record supports: candidates are compared on loops that are held out of the fit.

There are three candidates: rules without memory, a Preisach plane alone, and both in parallel. Every fifth loop of the
record is held out. It keeps its place in the path of the input, because the state of the wire depends on the whole
path, but its outputs are hidden from the fit. Memory must reduce the error on these loops clearly, because a plane has
hundreds of masses; and both parts together must be clearly better than the plane alone. The chosen candidate is then
fitted to the whole record.

The rules of a mixture are fitted to the output of its Duhem part, as without memory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import IdentificationError
from smadrive.hysteresis import PreisachPlane, TriangularSets, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.duhem import fit_duhem
from smadrive.identification.memory.incidence import Grid
from smadrive.identification.memory.mixture import fit_mixture
from smadrive.identification.memory.plane_fit import PlaneProblem, grid_of
from smadrive.identification.quality.fit import Fit, judge
from smadrive.identification.record import Record, prepare
from smadrive.identification.tsfuzzy.fit import fit_rules
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import whole_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MOST_TURNING_POINT_SETS = 40
"""The largest number of sets of the last turning point."""

COARSE = 28
"""Thresholds of the plane while its share beside the rules is sought."""

SMOOTHNESS = 0.002
"""Weight of the prior of the densities."""

HELD_OUT = 5
"""One of so many loops is held out."""

LEAST_LOOPS = 6
"""Loops of a record that can tell whether the wire has memory."""

_CLEARLY_BETTER = 0.6  # largest held-out error of a richer candidate, as a share of that of the plainer one
_MATERIAL = 0.1  # % of the output span by which memory must reduce the held-out error
_LEAST_SHARE = 0.03  # of the Duhem part of a mixture
_UNSEEN = 1e-6  # weight of a sample that is held out

NOTHING_LEFT = 0.2
"""RMS error of the rules, % of the output span, that leaves nothing for memory to explain; or the noise, if larger."""

FEWEST_TURNING_POINT_SETS = 4
"""The smallest number of sets of the last turning point of a model with memory."""

FitRules = Callable[[Record], tuple[TSFuzzyDuhem, float]]
"""A function that fits rules without memory to a record, and returns the model with the output at the first sample."""

Model = TSFuzzyDuhem | TSFuzzyPreisach


def identify_memory(
    v: ArrayLike, y: ArrayLike, sets: int = 11, *, memory: int | None = None, dead_band: float | None = None
) -> MemoryFit:
    """Fit T-S fuzzy rules to a record, and decide by loops held out how much memory the record supports.

    v and y are input and output of one wire, both (samples,). `sets` is the number of fuzzy sets of the rules. `memory`
    is the number of sets of the last turning point, from 4 to 40; 1 is no memory, and None lets the record decide.
    `dead_band` is as in identify_tsfuzzy. Raises the errors of identify_tsfuzzy, and IdentificationError for another
    number of sets.
    """
    if memory is not None and memory != 1:
        where, unit = "memory", "sets of the last turning point"
        whole_number(memory, where, unit, FEWEST_TURNING_POINT_SETS, MOST_TURNING_POINT_SETS, IdentificationError)
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
    return MemoryFit(**figures | {"caveats": (*fit.caveats, *choice.doubts)}, memory=choice)


def _chosen(record: Record, fit_these: FitRules) -> tuple[Model, float, MemoryChoice]:
    """Return the rules alone if they explain the record; otherwise the model that held-out loops prefer."""
    model, y0 = fit_these(record)
    misfit = 100 * record.misfit(model, y0)
    if misfit <= max(NOTHING_LEFT, 100 * record.noise):
        return model, y0, MemoryChoice(1, nan, nan)
    if loops_of(record)[-1] + 1 < LEAST_LOOPS:
        return model, y0, MemoryChoice(1, nan, nan, (_too_few_loops(record, misfit),))
    return choose(record, MOST_TURNING_POINT_SETS, fit_these)


def _too_few_loops(record: Record, misfit_percent: float) -> str:
    loops = int(loops_of(record)[-1]) + 1
    return (
        f"the rules leave {misfit_percent:.2g} % RMS, and {loops} loops are too few to tell whether the wire remembers "
        f"its turning points: record {LEAST_LOOPS} loops or more"
    )


@dataclass(frozen=True, slots=True)
class MemoryChoice:
    """The number of sets of the last turning point that was chosen; 1 is no memory.

    The held-out errors with and without memory are RMS errors on the loops that the fits did not see, % of the output
    span. They are NaN if the number of sets was given, or if the record has too few loops to tell.
    """

    sets: int
    with_percent: float
    without_percent: float
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class MemoryFit(Fit[Model]):
    """An identified T-S fuzzy model with or without memory, its metrics, and how its memory was chosen."""

    memory: MemoryChoice


def loops_of(record: Record) -> np.ndarray:
    """Return the number of the loop to which each cell of the record belongs. A loop is two monotone sections."""
    rising = record.rising
    turned = np.concatenate([[False], rising[1:] != rising[:-1]])
    return np.asarray(np.cumsum(turned) // 2)


def choose(record: Record, sets: int, fit_rules: FitRules) -> tuple[Model, float, MemoryChoice]:
    """Return the model that loops held out prefer, its output at the first sample, and how it was chosen.

    `sets` is the number of sets of the last turning point for the candidates with memory.
    """
    hidden = loops_of(record) % HELD_OUT == HELD_OUT - 1
    training = replace(record, count=np.where(hidden, _UNSEEN, record.count))
    candidates = _candidates(sets, fit_rules)
    errors = [_held_out(record, hidden, *fit(training)) for fit in candidates]
    without, plane, both = errors
    memory, best = (1, plane) if plane <= both / _CLEARLY_BETTER else (2, both)
    chosen = memory if best < _CLEARLY_BETTER * without and without - best > _MATERIAL else 0
    return *candidates[chosen](record), MemoryChoice(sets if chosen else 1, best, without)


def with_memory(record: Record, sets: int, fit_rules: FitRules) -> tuple[Model, float, MemoryChoice]:
    """Return the better of the two candidates with memory on the record itself, with `sets` turning-point sets."""
    _, *candidates = _candidates(sets, fit_rules)
    fits = [fit(record) for fit in candidates]
    plane, both = (record.misfit(*fit) for fit in fits)
    return *fits[0 if plane <= both / _CLEARLY_BETTER else 1], MemoryChoice(sets, nan, nan)


def _candidates(sets: int, fit_rules: FitRules) -> tuple[Callable[[Record], tuple[Model, float]], ...]:
    return (
        fit_rules,
        lambda record: _plane_alone(record, sets),
        lambda record: _both(record, sets, fit_rules),
    )


def _held_out(record: Record, hidden: np.ndarray, model: Model, y0: float) -> float:
    """Return the RMS error on the hidden cells, % of the output span."""
    error = (model.simulate(record.v, y0) - record.mean_y)[hidden] / record.output_span
    count = record.count[hidden]
    return float(100 * np.sqrt(count @ error**2 / count.sum()))


class _Plane:
    """The masses of a plane on a grid, as they are fitted: not normalised, and negative if the output falls."""

    def __init__(self, record: Record, thresholds: int) -> None:
        self.grid: Grid = grid_of(record, thresholds)
        lower, upper = record.input_range
        turns = (lower,) if record.v[0] < 0.5 * (lower + upper) else (lower, upper)
        self.sign = 1.0 if np.corrcoef(record.v, record.mean_y)[0, 1] > 0 else -1.0
        self.shares_on = self.grid.shares_on(record.v, turns)
        self.problem = PlaneProblem.of(self.shares_on, np.sqrt(record.count), self.grid, SMOOTHNESS)

    def model(self, rules: TSFuzzyDuhem, output: tuple[float, float], masses: FloatArray) -> TSFuzzyPreisach:
        """Return the model that adds `masses`, in the unit of y, to the rules.

        `output` holds scale and offset of the part of the rules.
        """
        mass = np.zeros(self.grid.cells.shape)
        mass[self.grid.cells] = masses / masses.sum()
        plane = PreisachPlane(self.grid.up, self.grid.down, mass / mass.sum())
        added = self.sign * float(masses.sum())
        scale, offset = output[0] + added, output[1]
        laws = rules.heating_law, rules.cooling_law
        whole = TSFuzzyDuhem.from_laws(rules.sets, *laws, scale, offset, rules.input_range)
        return TSFuzzyPreisach(whole, plane, added / scale)


def _plane_alone(record: Record, sets: int) -> tuple[Model, float]:
    plane = _Plane(record, sets)
    bottom, masses = plane.problem.with_bottom(plane.sign * record.mean_y)
    duhem = fit_duhem(record, components=1).model
    centres = TriangularSets(tuple(np.linspace(*record.input_range, 11).tolist()))
    rules = TSFuzzyDuhem.from_duhem(duhem, centres)
    model = plane.model(rules, (0.0, plane.sign * bottom), masses)
    return model, float(model.initial_state(float(record.v[0]), float(record.mean_y[0])).y)


def _both(record: Record, sets: int, fit_rules: FitRules) -> tuple[Model, float]:
    """Return rules and a plane in parallel; the plane alone if the rules have no part in it."""
    coarse = _Plane(record, min(sets, COARSE))
    sign, span = coarse.sign, record.output_span
    duhem = fit_duhem(record, components=1).model
    (mu_up, sigma_up), (mu_down, sigma_down) = (
        (mixture.means[0], mixture.sigmas[0]) for mixture in (duhem.heating, duhem.cooling)
    )
    start = np.array([mu_up, mu_down, sigma_up, sigma_down])
    mixture = fit_mixture(coarse.problem, record.v, sign * record.mean_y / span, record.input_range, start)
    if float(np.ptp(mixture.duhem)) < _LEAST_SHARE:
        return _plane_alone(record, sets)
    fine = _Plane(record, sets)
    masses = fine.problem.masses(sign * record.mean_y - span * mixture.duhem)
    if masses.sum() < _LEAST_SHARE * span:
        return fit_rules(record)
    rules, _ = fit_rules(prepare(record.v, sign * span * mixture.duhem, 0.0))
    model = fine.model(rules, (rules.scale, rules.offset), masses)
    return model, float(model.initial_state(float(record.v[0]), float(record.mean_y[0])).y)
