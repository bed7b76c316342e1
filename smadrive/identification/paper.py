"""The published simulation: 11 x 2 rules rebuild a Duhem model on the input range [-300, 300].

S.-Y. Lee, M. Park, J. Baek, "Modeling of Dynamic Hysteresis Based on Takagi-Sugeno Fuzzy Duhem Model", IJFIS 2013.
The output of the Duhem model is k = 40 times its state. The paper shows its input signals as figures, without a table.
Here, the major loop is one sweep of the range and back; the mixed loop adds shrinking reversals.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.identification.tsfuzzy.fit import identify_tsfuzzy
from smadrive.numerics.arrays import FloatArray

SETS = 11
PAPER_ERROR = (-1.2, 1.0)
"""Smallest and largest error of the output that the paper reports, in the unit of the output."""

RANDOM_LOOPS = 100
SAMPLES_PER_STRETCH = 200


@dataclass(frozen=True)
class Errors:
    """The errors of a rebuilt model: its output minus that of the Duhem model.

    name             name of the rebuilt model
    major            smallest and largest error on the major loop, in the unit of the output (full range: k = 40)
    mixed            smallest and largest error on the mixed loop, in the unit of the output
    unseen_percent   median and maximum, over `RANDOM_LOOPS` random loops, of the largest error on a loop, in % of k; no
                     fit used these loops
    """

    name: str
    major: tuple[float, float]
    mixed: tuple[float, float]
    unseen_percent: tuple[float, float]


def rebuild(duhem: DuhemModel) -> dict[str, TSFuzzyDuhem]:
    """Return three models of 11 x 2 rules by name: one derived from the Duhem model, two identified from its output."""
    uniform = np.linspace(*duhem.input_range, SETS)
    path = np.concatenate([major_loop(), random_loop(np.random.default_rng(2013), turns=120)])
    y = duhem.simulate(path)
    return {
        "derived, uniform sets": TSFuzzyDuhem.from_duhem(duhem, TriangularSets(tuple(uniform))),
        "identified, uniform sets": identify_tsfuzzy(path, y, sets=uniform.tolist(), fit_centres=False).model,
        "identified, fitted sets": identify_tsfuzzy(path, y, sets=SETS).model,
    }


def judge(name: str, model: TSFuzzyDuhem, duhem: DuhemModel) -> Errors:
    """Return the errors of the rebuilt `model`, with its `name`, on all loops."""

    def error(path: FloatArray) -> FloatArray:
        return model.simulate(path) - duhem.simulate(path)

    random = np.random.default_rng(7)
    worst = [float(np.max(np.abs(error(random_loop(random, turns=12))))) for _ in range(RANDOM_LOOPS)]
    unseen = 100.0 * np.array(worst) / duhem.scale
    major, mixed = error(major_loop()), error(mixed_loop())
    return Errors(
        name,
        (float(major.min()), float(major.max())),
        (float(mixed.min()), float(mixed.max())),
        (float(np.median(unseen)), float(np.max(unseen))),
    )


def major_loop() -> FloatArray:
    """Return the input of the major loop: from -300 to 300 and back."""
    return stretches([-300.0, 300.0, -300.0])


def mixed_loop() -> FloatArray:
    """Return the input of the mixed loop: the major loop, followed by shrinking reversals inside it."""
    return stretches([-300.0, 300.0, -300.0, 200.0, -150.0, 120.0, -90.0, 60.0, -300.0])


def random_loop(random: np.random.Generator, turns: int) -> FloatArray:
    """Return an input that goes from -300 through `turns` random turning points between -300 and 300."""
    return stretches([-300.0, *random.uniform(-300.0, 300.0, size=turns).tolist()])


def stretches(turns: list[float]) -> FloatArray:
    """Return the input through the turning points `turns`, with `SAMPLES_PER_STRETCH` samples from one to the next."""
    return np.concatenate([np.linspace(a, b, SAMPLES_PER_STRETCH) for a, b in pairwise(turns)])
