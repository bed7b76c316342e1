"""The resistance at rest that the next run is expected to find, and how far it may be away.

The last runs of a wire show how far its resistance strays from the model without a fault: by the model's error over the
loop (`rest_spread` of an entry), and from run to run. The tolerance is a multiple of the second largest of these
deviations: one run with a fault that was too small to be found does not hide the next fault. Before enough runs are
recorded, the tolerance is the largest deviation that a sound wire can have: nickel-titanium changes its resistance by
10 to 20 % over the transformation, and by about 0.1 % per kelvin within a phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from smadrive.wire.health.entry import HealthEntry

RUNS, LEAST_RUNS = 8, 3
"""The tolerance comes from the last `RUNS` runs without a trip, if there are at least `LEAST_RUNS` of them."""

GATE = 2.0
"""The tolerance, as a multiple of the second largest deviation of these runs."""

LEAST_TOLERANCE, MOST_TOLERANCE = 0.03, 0.25
"""A sound crimp changes the resistance of a wire by some percent when it is moved; a larger change is a fault.

The largest tolerance is the largest deviation of a sound wire, as the head of this file explains.
"""


class ExpectedRest(NamedTuple):
    """The expected resistance at rest in Ω, and the tolerance as a share of it."""

    ohm: float
    tolerance: float


def expected_rest(entries: Sequence[HealthEntry], model: str, identified_ohm: float) -> ExpectedRest:
    """Return what the next run is expected to find.

    `entries` are those of the wire's record, `model` is the key of its model, `identified_ohm` its cold resistance in
    the wire file. Only runs since the last identification count, and only if it was the one of this model.
    """
    starts = [number for number, entry in enumerate(entries) if entry.is_identification]
    if not starts or entries[starts[-1]].model != model:
        return ExpectedRest(identified_ohm, MOST_TOLERANCE)
    runs = [run for run in entries[starts[-1] + 1 :] if run.rest_ohm.is_known and not run.tripped][-RUNS:]
    if len(runs) < LEAST_RUNS:
        return ExpectedRest(identified_ohm, MOST_TOLERANCE)
    ohm = median(run.rest_ohm.value for run in runs)
    deviations = sorted(abs(run.rest_ohm.value / ohm - 1.0) + run.rest_spread for run in runs)
    return ExpectedRest(ohm, min(max(GATE * deviations[-2], LEAST_TOLERANCE), MOST_TOLERANCE))
