"""Inverse feedforward: the input that brings the wire to an output setpoint.

The output setpoint corresponds to a state w1. The wire has the state w0 at the input v0. So the direction of the input
is sign(w1 - w0). If the `invertible_share` of the certificate is 1, w(v) is monotone in this direction, and w(v1) = w1
has at most one solution v1. `HysteresisModel.reach` finds this input. An unreachable setpoint is not an error: the
result is the end of the range, with `reachable` False. In real time w0 must be the estimated state of the wire, not
that of the setpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smadrive.errors import DataError
from smadrive.numerics.arrays import FloatArray, finite_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from smadrive.hysteresis.model import HysteresisModel, HysteresisState

_CLOSE = 1e-10  # of the scale: closer than this the output counts as reached


class Inversion(NamedTuple):
    """The state that the wire reaches. Its input `v` is the command, and its output is `y`.

    `reachable` is True if y is equal to the setpoint, up to rounding.
    """

    state: HysteresisState
    reachable: bool

    @property
    def v(self) -> float:
        """The input to command."""
        return self.state.v

    @property
    def y(self) -> float:
        """The output at this input."""
        return self.state.y


@dataclass(frozen=True, slots=True)
class InverseTrajectory:
    """Inputs `v`, the outputs `y` that they give, and `reachable` for each setpoint; all of shape (samples,)."""

    v: FloatArray
    y: FloatArray
    reachable: NDArray[np.bool_]


class InverseFeedforward:
    """The inverse of a hysteresis model: `update` inverts one setpoint, `trajectory` a whole reference."""

    def __init__(self, model: HysteresisModel) -> None:
        self.model = model

    def update(self, state: HysteresisState, y_setpoint: float) -> Inversion:
        """Return the input that takes the wire from `state` to the output `y_setpoint`, and the state at this input.

        For an unreachable setpoint this input is the end of the range, and `reachable` is False. Raises DataError for a
        setpoint that is not finite.
        """
        if not isfinite(y_setpoint):
            raise DataError("not finite", where="output setpoint", value=y_setpoint)
        model = self.model
        w1 = (float(y_setpoint) - model.offset) / model.scale
        if abs(w1 - state.w) <= _CLOSE:
            return Inversion(state, True)
        reached = model.reach(state, w1)
        return Inversion(reached, abs(reached.w - w1) <= 10 * _CLOSE)

    def trajectory(self, y_ref: ArrayLike, v0: float, y0: float | None = None) -> InverseTrajectory:
        """Return the inputs that take the wire along a reference path of outputs, `y_ref` (samples,).

        The path starts at input v0 and output y0; without y0 it starts on the heating branch. Raises DataError for
        values that are not finite, and for more than one dimension.
        """
        setpoints = finite_array("reference y_ref", y_ref)
        if setpoints.ndim != 1:
            raise DataError("not 1-D", where="y_ref", value=setpoints.shape, cure="pass the reference of one wire")
        state = self.model.initial_state(v0, y0)
        inversions = []
        for y in setpoints.tolist():
            inversions.append(self.update(state, y))
            state = inversions[-1].state
        v, y_reached, reachable = zip(*((one.v, one.y, one.reachable) for one in inversions), strict=True)
        return InverseTrajectory(np.array(v), np.array(y_reached), np.array(reachable))
