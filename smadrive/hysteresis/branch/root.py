"""The input at which a monotone section of a model reaches a given state, by a bracketed Newton iteration."""

from __future__ import annotations

from collections.abc import Callable
from math import log

_ITERATIONS = 100
_CLOSE = 1e-13  # of w

Section = Callable[[float], tuple[float, float]]
"""A function that returns w and dw/dv at an input of the section."""


def find_input(
    section: Section, w1: float, near: float, far: float, guess: float, *, rising: bool
) -> tuple[float, float]:
    """Return the input between `near` and `far` at which `section` reaches the state `w1`, and the state at this input.

    `section` returns w and dw/dv at an input. The input moves from `near` to `far`, upward if `rising`. `guess` is the
    first trial. If the section does not reach `w1`, the result is `far` and the state at `far`.
    """
    v, end_checked = guess, False
    for _ in range(_ITERATIONS):
        w, slope = section(v)
        missing = w1 - w
        if -_CLOSE < missing < _CLOSE:
            break
        if (missing > 0) == rising:
            if v == far:
                break
            near = v
        else:
            far, end_checked = v, True
        newton = v + missing / slope if slope > 0 else far
        if near < newton < far or far < newton < near:
            v = newton
        elif end_checked:
            v = (near + far) / 2
            if v in (near, far):
                break
        else:
            v = far
    return v, w


def first_guess(a: float, slope: float, change: float, near: float, far: float) -> float:
    """Return the input between `near` and `far` at which the state has changed by `change`, for constant a and b.

    The law is dw/dv = a w + b, and `slope` is dw/dv at `near`. If there is no such input, the result is `far`.
    """
    end = slope + a * change
    if slope <= 0 or end <= 0:
        return far
    guess = near + (log(end / slope) / a if a else change / slope)
    return guess if near < guess < far or far < guess < near else far
