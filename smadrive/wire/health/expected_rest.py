"""The expected resistance at rest of the next run, and its tolerance.

The last runs of a wire show how much its resistance deviates from the model without a fault: within a run
(`rest_spread` of an entry), and from run to run. The tolerance is a multiple of the second largest of these deviations.
So one run with an undetected fault does not hide the next fault. Before enough runs are recorded, the tolerance is the
largest deviation that a sound wire can have: nickel-titanium changes its resistance by 10 to 20 % over the
transformation, and by about 0.1 % per kelvin within a phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from statistics import median
from typing import NamedTuple

from smadrive.wire.health.entry import HealthEntry

RUNS, LEAST_RUNS = 8, 3
"""The tolerance comes from the last `RUNS` runs without a trip, if there are at least `LEAST_RUNS` of them."""

GATE = 2.0
"""The tolerance, as a multiple of the second largest deviation of the last runs."""

LEAST_TOLERANCE, MOST_TOLERANCE = 0.03, 0.25
"""Smallest and largest tolerance, as shares of the resistance.

The smallest tolerance allows for a sound crimp that is moved: this changes the resistance by some percent. The largest
tolerance is the largest deviation of a sound wire, as the head of this file explains.
"""


class ExpectedRest(NamedTuple):
    """The expected resistance at rest in Ω, and its tolerance as a share of this resistance."""

    ohm: float
    tolerance: float


def expected_rest(entries: Sequence[HealthEntry], model: str, identified_ohm: float) -> ExpectedRest:
    """Return the expected resistance at rest of the next run, and its tolerance.

    `entries` are the entries of the wire's record. `model` is the key of the wire's model, `identified_ohm` the cold
    resistance in the model file. Only runs since the last identification count. No run counts if the last
    identification gave another model than `model`.
    """
    starts = [number for number, entry in enumerate(entries) if entry.is_identification]
    if not starts or entries[starts[-1]].model != model:
        return ExpectedRest(identified_ohm, MOST_TOLERANCE)
    runs = [run for run in entries[starts[-1] + 1 :] if _counts(run)][-RUNS:]
    if len(runs) < LEAST_RUNS:
        return ExpectedRest(identified_ohm, MOST_TOLERANCE)
    ohm = median(map(_rest_ohm, runs))
    deviations = sorted(abs(_rest_ohm(run) / ohm - 1.0) + run.rest_spread for run in runs)
    return ExpectedRest(ohm, min(max(GATE * deviations[-2], LEAST_TOLERANCE), MOST_TOLERANCE))


def _counts(run: HealthEntry) -> bool:
    """Return True for a run without a trip whose resistance at rest, and its deviation within the run, are known."""
    return isfinite(_rest_ohm(run)) and isfinite(run.rest_spread) and not run.tripped


def _rest_ohm(run: HealthEntry) -> float:
    """Return the resistance at rest by the measured displacement, or if there is none, by the estimated one, Ω."""
    return run.rest_ohm.value if run.rest_ohm.is_known else run.estimated_rest_ohm.value
