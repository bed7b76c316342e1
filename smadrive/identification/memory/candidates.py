"""Models with memory, fitted to a record: a Preisach plane alone, or rules and a plane in parallel.

For rules and a plane, `parallel.py` first divides the output of the record into a part of the rules and a part of the
plane. Then the rules are fitted to their part of the output, in the same way as rules without memory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from smadrive.errors import SmadriveError
from smadrive.hysteresis import DuhemModel, PreisachPlane, TriangularSets, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.memory.incidence import PlaneGrid
from smadrive.identification.memory.parallel import duhem_part
from smadrive.identification.memory.plane_fit import PlaneProblem, grid_of
from smadrive.identification.record import Record, prepare
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import whole_number

TURNING_POINT_SETS = (4, 40)
"""The smallest and the largest number of sets of the last turning point of a model with memory."""

COARSE = 28
"""Largest number of thresholds on each axis of the plane while the output is divided between rules and plane."""

SMOOTHNESS = 0.002
"""Weight λ of the prior that compares the densities of neighbouring cells (see plane_fit.py)."""

_LEAST_SHARE = 0.03  # smallest part of the rules or of the plane that is not negligible, in output spans

FitRules = Callable[[Record], tuple[TSFuzzyDuhem, float]]
"""A function that fits rules without memory to a record, and returns the model with its output at the first sample."""

Model = TSFuzzyDuhem | TSFuzzyPreisach


def check_memory(memory: object, error: type[SmadriveError], where: str = "memory") -> None:
    """Raise `error` unless `memory` is 1 (no memory), or a number of sets of the last turning point."""
    if memory == 1 and not isinstance(memory, bool):
        return
    try:
        whole_number(memory, where, "sets of the last turning point", *TURNING_POINT_SETS, error)
    except error as wrong:
        wrong.limit = f"1 for no memory, or {wrong.limit}"
        raise


class _Plane:
    """A plane for a record: its grid, and the fit of its masses.

    `sign` is -1 if the output falls when the input rises. Masses are never negative, so they are
    fitted to `sign` times the output.
    """

    def __init__(self, record: Record, thresholds: int) -> None:
        self.grid: PlaneGrid = grid_of(record, thresholds)
        lower, upper = record.input_range
        turns = (lower,) if record.v[0] < 0.5 * (lower + upper) else (lower, upper)
        self.sign = 1.0 if np.corrcoef(record.v, record.mean_y)[0, 1] > 0 else -1.0
        self.problem = PlaneProblem.of(
            self.grid.shares_on(record.v, turns), np.sqrt(record.count), self.grid, SMOOTHNESS
        )

    def model(self, rules: TSFuzzyDuhem, output: tuple[float, float], masses: FloatArray) -> TSFuzzyPreisach:
        """Return the model of `rules` and this plane in parallel.

        `output` holds scale and offset of the part of the rules. `masses` (cells,) are those of the plane. Scale,
        offset and masses have the unit of y.
        """
        mass = np.zeros(self.grid.cells.shape)
        mass[self.grid.cells] = masses / masses.sum()
        plane = PreisachPlane(self.grid.up, self.grid.down, mass / mass.sum())
        added = self.sign * float(masses.sum())
        scale, offset = output[0] + added, output[1]
        laws = rules.heating_law, rules.cooling_law
        whole = TSFuzzyDuhem.from_laws(rules.sets, *laws, scale, offset, rules.input_range)
        return TSFuzzyPreisach(whole, plane, added / scale)


def plane_alone(record: Record, sets: int, duhem: DuhemModel) -> tuple[Model, float]:
    """Return a Preisach plane that is fitted to `record`, and the output of this model at the first sample.

    The plane has at most `sets` thresholds on each axis. The model also holds rules that follow from `duhem`, but their
    share of the output is 0.
    """
    plane = _Plane(record, sets)
    bottom, masses = plane.problem.with_bottom(plane.sign * record.mean_y)
    centres = TriangularSets(tuple(np.linspace(*record.input_range, 11).tolist()))
    rules = TSFuzzyDuhem.from_duhem(duhem, centres)
    model = plane.model(rules, (0.0, plane.sign * bottom), masses)
    return model, float(model.initial_state(float(record.v[0]), float(record.mean_y[0])).y)


def rules_and_plane(record: Record, sets: int, duhem: DuhemModel, fit_rules: FitRules) -> tuple[Model, float]:
    """Return rules and a Preisach plane in parallel, fitted to `record`, and the model's output at the first sample.

    The plane has at most `sets` thresholds on each axis. `duhem` has one Gaussian per branch, and the search for the
    part of the rules starts from the parameters of `duhem`. `fit_rules` fits the rules. If the part of the rules is
    negligible, the model is a plane alone; if the part of the plane is negligible, it is rules without memory.
    """
    coarse = _Plane(record, min(sets, COARSE))
    sign, span = coarse.sign, record.output_span
    (mu_up, sigma_up), (mu_down, sigma_down) = (
        (branch.means[0], branch.sigmas[0]) for branch in (duhem.heating, duhem.cooling)
    )
    start = np.array([mu_up, mu_down, sigma_up, sigma_down])
    duhem_output = duhem_part(coarse.problem, record.v, sign * record.mean_y / span, record.input_range, start)
    if float(np.ptp(duhem_output)) < _LEAST_SHARE:
        return plane_alone(record, sets, duhem)
    fine = _Plane(record, sets)
    masses = fine.problem.masses(sign * record.mean_y - span * duhem_output)
    if masses.sum() < _LEAST_SHARE * span:
        return fit_rules(record)
    part = prepare(record.v, sign * span * duhem_output, 0.0)
    rules, _ = fit_rules(replace(part, input_range=record.input_range))
    model = fine.model(rules, (rules.scale, rules.offset), masses)
    return model, float(model.initial_state(float(record.v[0]), float(record.mean_y[0])).y)
