"""The states of a Preisach plane along a whole input path: one array expression for all samples.

The stack of turning points is followed once for each monotone section of the path. The stack changes when the input
reverses, and when the input passes an older turning point. Between two changes, the state is a constant plus or minus a
value of the Everett function.
"""

from __future__ import annotations

import numpy as np

from smadrive.hysteresis.memory.plane import PreisachPlane
from smadrive.hysteresis.turning_points import Memory, is_rising, pieces, reversed_at
from smadrive.numerics.arrays import FloatArray


def plane_states(plane: PreisachPlane, v: FloatArray, start: Memory) -> FloatArray:
    """Return the state of `plane` at every sample of the input path `v`; path and result are (samples,).

    `start` is the memory of the wire at the first sample.
    """
    moves = np.flatnonzero(np.diff(v)) + 1
    path = v[np.concatenate([[0], moves])]
    samples = np.searchsorted(moves, np.arange(len(v)), side="right")
    return _moving_states(plane, path, start)[samples]


def _moving_states(plane: PreisachPlane, path: FloatArray, start: Memory) -> FloatArray:
    """Return the states along a path whose input changes at every sample."""
    states = np.full(len(path), start.plane)
    if len(path) == 1:
        return states
    rising = path[1:] > path[:-1]
    corners = np.concatenate([[0], np.flatnonzero(rising[1:] != rising[:-1]) + 1, [len(rising)]])
    first, turn, base = _events(plane, path, corners, rising[corners[:-1]], start)
    lengths = np.diff([*first, len(path)])
    turns, bases = np.repeat(turn, lengths), np.repeat(base, lengths)
    inputs = path[1:]
    sign = np.where(rising, 1.0, -1.0)
    states[1:] = bases + sign * plane.everett_values(np.where(rising, inputs, turns), np.where(rising, turns, inputs))
    return states


def _events(
    plane: PreisachPlane, path: FloatArray, corners: np.ndarray, rising: np.ndarray, start: Memory
) -> tuple[list[int], list[float], list[float]]:
    """Return three lists with one entry for each part of the path between two changes of the stack.

    first   first sample of the part
    turn    turning point at which the section of the part began
    base    the constant of the part: p without the value of the Everett function
    """
    p, turns = start.plane, start.turns
    first: list[int] = []
    turn: list[float] = []
    base: list[float] = []
    corner_inputs, ends = path[corners].tolist(), corners.tolist()
    for section, up in enumerate(rising.tolist()):
        begin, end = corner_inputs[section], corner_inputs[section + 1]
        if up != is_rising(turns):
            turns = reversed_at(turns, begin)
        parts, turns = pieces(turns, end)
        inside, sample = path[ends[section] + 1 : ends[section + 1] + 1], ends[section] + 1
        for at, reached in parts:
            constant = p - plane.everett(begin, at) if up else p + plane.everett(at, begin)
            first.append(sample)
            turn.append(at)
            base.append(constant)
            p = constant + plane.everett(reached, at) if up else constant - plane.everett(at, reached)
            begin = reached
            passed = np.searchsorted(inside, reached, "right") if up else np.searchsorted(-inside, -reached, "right")
            sample = ends[section] + 1 + int(passed)
    return first, turn, base
