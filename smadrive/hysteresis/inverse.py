"""Inverse feedforward: the input that brings the wire to an output setpoint.

The setpoint w1 and the state (v0, w0) determine the direction, sign(w1 - w0). On the branch of this direction,

    P(v1) + (w0 - P(v0)) exp(Λ(v1) - Λ(v0)) = w1

has one solution v1, found by a bracketed Newton iteration. The first guess is the exact solution for constant a and b,
Δv = ln((a w1 + b)/(a w0 + b))/a. An unreachable setpoint is not an error: the result is the end of the range, with
`reachable` False. In real time the state must be the estimated state of the wire, not the setpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, isfinite, log
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smadrive.errors import DataError
from smadrive.numerics.arrays import FloatArray, finite_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from smadrive.hysteresis.model import HysteresisModel, HysteresisState

_CLOSE = 1e-10  # of the scale: closer than this the output counts as reached
_ITERATIONS = 100


class Inversion(NamedTuple):
    """The input `v` to command, and the output `y` at this input.

    `reachable` is True if y is the setpoint, up to rounding.
    """

    v: float
    y: float
    reachable: bool


@dataclass(frozen=True, slots=True)
class InverseTrajectory:
    """Inputs `v`, the outputs `y` that they give, and `reachable` for each setpoint; all of shape (samples,)."""

    v: FloatArray
    y: FloatArray
    reachable: NDArray[np.bool_]


class InverseFeedforward:
    """The inverse of a hysteresis model: `update` for one sample, `trajectory` for a whole reference."""

    def __init__(self, model: HysteresisModel) -> None:
        self.model = model

    def update(self, state: HysteresisState, y_setpoint: float) -> Inversion:
        """Return the input that takes the wire from `state` to `y_setpoint`, and the output that it reaches.

        DataError for a setpoint that is not finite.
        """
        if not isfinite(y_setpoint):
            raise DataError("not finite", where="output setpoint", value=y_setpoint)
        model = self.model
        w1 = (y_setpoint - model.offset) / model.scale
        if abs(w1 - state.w) <= _CLOSE:
            return Inversion(state.v, state.y, True)
        v, w = self._solve(state, w1)
        return Inversion(v, model.offset + model.scale * w, abs(w - w1) <= 10 * _CLOSE)

    def trajectory(self, y_ref: ArrayLike, v0: float, y0: float | None = None) -> InverseTrajectory:
        """Return the inputs for a reference path `y_ref` (samples,), sample by sample.

        The path starts at input v0 and output y0; without y0 it starts on the heating branch. Raises DataError for
        values that are not finite, and for more than one dimension.
        """
        setpoints = finite_array("reference y_ref", y_ref)
        if setpoints.ndim != 1:
            raise DataError("not 1-D", where="y_ref", value=setpoints.shape, cure="pass the reference of one wire")
        state = self.model.initial_state(v0, y0)
        inversions = []
        for y in setpoints.tolist():
            inversion = self.update(state, y)
            state = self.model.step(state, inversion.v)
            inversions.append(inversion)
        v, y_reached, reachable = zip(*inversions, strict=True)
        return InverseTrajectory(np.array(v), np.array(y_reached), np.array(reachable))

    def _solve(self, state: HysteresisState, w1: float) -> tuple[float, float]:
        """Return v1 and the state at v1, by bracketed Newton between the present input and the end of the range."""
        engine = self.model.engine
        rising = w1 > state.w
        v0 = engine.clamp(state.v)
        near, far = v0, engine.upper if rising else engine.lower
        if near == far:
            return v0, state.w
        node, p0, p1, p2, p3, l0, l1, l2, l3 = engine.row(v0, rising)
        t = v0 - node
        excess = state.w - (((p3 * t + p2) * t + p1) * t + p0)
        exponent = ((l3 * t + l2) * t + l1) * t + l0
        v = _first_guess(engine.local_law(v0, rising=rising), v0, state.w, w1, far)
        w = state.w
        end_checked = False
        for _ in range(_ITERATIONS):
            node, p0, p1, p2, p3, l0, l1, l2, l3 = engine.row(v, rising)
            t = v - node
            decayed = excess * exp(((l3 * t + l2) * t + l1) * t + l0 - exponent)
            w = ((p3 * t + p2) * t + p1) * t + p0 + decayed
            missing = w1 - w
            if -1e-13 < missing < 1e-13:
                break
            if (missing > 0) == rising:
                if v == far:
                    break
                near = v
            else:
                far, end_checked = v, True
            slope = (3 * p3 * t + 2 * p2) * t + p1 + decayed * ((3 * l3 * t + 2 * l2) * t + l1)
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


def _first_guess(law: tuple[float, float], v0: float, w0: float, w1: float, far: float) -> float:
    a, b = law
    start, end = a * w0 + b, a * w1 + b
    if a == 0 or start <= 0 or end <= 0:
        return far
    guess = v0 + log(end / start) / a
    return guess if min(v0, far) < guess < max(v0, far) else far
