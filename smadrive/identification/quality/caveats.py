"""Reasons to distrust an identified model, one sentence each.

A certificate proves properties of the rules of a model. A certified model can still be wrong about the wire: it may
fail to reproduce the record, or its output in a gap of the record may be arbitrary. The metrics alone do not show this.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from smadrive.identification.record import Record

if TYPE_CHECKING:
    from smadrive.hysteresis import HysteresisModel
    from smadrive.hysteresis.mixture import GaussianMixture
    from smadrive.identification.quality.uncertainty import MixtureErrors

_POOR = 5.0  # % RMS of the output span; one Gaussian per branch leaves 2 to 4 on measured wires
_BRIDGED = 20.0  # % of the output span that a branch may move between two neighbouring inputs


def misses_record(rms_percent: float) -> tuple[str, ...]:
    """Return a caveat when the model reproduces its own record badly, otherwise an empty tuple.

    `rms_percent` is the RMS error of the model, % of the output span.
    """
    if rms_percent <= _POOR:
        return ()
    missed = f"the model misses its own record by {rms_percent:.1f} % RMS of the output span; usual are 1 to 2 %"
    return (f"{missed}: look at the plot, and record one wire under one load",)


def bridges_gaps(model: HysteresisModel, record: Record) -> tuple[str, ...]:
    """Return a caveat for each branch with a large step of the model's output between neighbouring recorded inputs."""
    found = []
    for name, rising in (("rising", True), ("falling", False)):
        reached = np.flatnonzero(record.rising == rising)
        visited = np.unique(record.v[np.concatenate([reached, np.maximum(reached - 1, 0)])])
        steps = np.abs(np.diff(model.branch(visited, rising=rising))) * abs(model.scale)
        widest = int(np.argmax(steps))
        percent = 100 * steps[widest] / record.output_span
        if percent > _BRIDGED:
            gap = f"between the inputs {visited[widest]:.4g} and {visited[widest + 1]:.4g}"
            found.append(
                f"on {name} input the model guesses {percent:.0f} % of the output span, because the record has no "
                f"sample {gap}: record this part, or record more slowly"
            )
    return tuple(found)


def undetermined(branch: str, mixture: GaussianMixture, errors: MixtureErrors) -> tuple[str, ...]:
    """Return a caveat when the weight of a Gaussian is less than twice its standard error, otherwise an empty tuple.

    `mixture` is the branch with the name `branch`, and `errors` are the standard errors of its parameters.
    """
    count = len(mixture.weights)
    weight, error = min(zip(mixture.weights, errors.weights, strict=True), key=lambda one: one[0] / max(one[1], 1e-12))
    if weight >= 2 * error:
        return ()
    advice = f"a weight of {weight:.2f} is known to ±{2 * error:.2g} only; use fewer components, or record inner loops"
    return (f"the record does not determine the {count} Gaussians of the {branch} branch: {advice}",)
