"""The loops in the record of a wire, and two checks of a run: is it near these loops, and does the model drop turns?

A model with memory knows the wire after a turning point only if the record turned at about the same input. So the
sections of the record are kept with the model, each as its turning point and its end. If several sections of the same
direction turn at about the same input, only the longest is kept. A section of a run is near the record if a recorded
section of the same direction turned at most `NEAR` of the recorded range away, and came to within the same distance of
the end of the section, or beyond this end. A section shorter than this distance is always near.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from smadrive.hysteresis import TSFuzzyPreisach
from smadrive.hysteresis.reversal import turning_points
from smadrive.numerics.arrays import FloatArray

Sections = tuple[tuple[float, float], ...]
"""Sections of an input path, each as (turning point, end), in the unit of the input."""

NEAR = 0.1
"""Largest distance from a recorded section, as a share of the recorded range of the input."""

SAME = 0.01
"""Turning points that differ by less than this share of the recorded range count as one."""


def sections_of(path: FloatArray, radius: float = 0.0) -> Sections:
    """Return the sections of an input path (samples,). A reversal by at most 2 · `radius` does not begin a section."""
    corners = path[turning_points(path, radius)].tolist()
    return tuple((turn, end) for turn, end in pairwise(corners) if turn != end)


def recorded_sections(path: FloatArray) -> Sections:
    """Return the sections of a record with the input `path` (samples,), at most one per turning point and direction."""
    grid = SAME * float(np.ptp(path))
    longest: dict[tuple[bool, int], tuple[float, float]] = {}
    for turn, end in sections_of(path):
        key = end > turn, round(turn / grid)
        if key not in longest or abs(end - turn) > abs(longest[key][1] - longest[key][0]):
            longest[key] = turn, end
    return tuple(longest.values())


def outside(run: Sections, recorded: Sections) -> Sections:
    """Return the sections of a run that are not near the `recorded` sections; () if `recorded` is empty.

    Outside of the recorded range a wire does not transform, so both ends of a section are first clamped to this range.
    """
    if not recorded:
        return ()
    low, high = np.min(recorded), np.max(recorded)
    near = NEAR * (high - low)
    turns, ends = np.array(recorded).T
    found = []
    for turn, end in np.clip(np.reshape(run, (-1, 2)), low, high).tolist():
        way = 1.0 if end > turn else -1.0
        is_near = (np.abs(turns - turn) <= near) & (way * (ends - turns) > 0) & (way * (ends - end) >= -near)
        if abs(end - turn) > near and not is_near.any():
            found.append((turn, end))
    return tuple(found)


def dropped_turns(model: TSFuzzyPreisach, run: Sections) -> int:
    """Return the number of turning points that `model` drops on a run, because too many loops lie inside each other."""
    if not run:
        return 0
    state = model.initial_state(run[0][0])
    for _, end in run:
        state = model.step(state, end)
    return 0 if state.memory is None else state.memory.dropped
