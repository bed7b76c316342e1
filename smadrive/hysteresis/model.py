"""The common part of all hysteresis models. A step takes a state and returns the next one; a model keeps no state.

    w  normalised state in [0, 1], the transformed fraction          y = offset + scale · w    (scale may be negative)
    v  input. The state follows the heating law while v rises, and the cooling law while v falls.

Inside `input_range` a step is exact for any distance. Outside, the transformation counts as complete: the input is
clamped to the range, the state is constant and the slope is zero. So a wrong reading of a sensor cannot make the model
diverge.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smadrive.display.card import card
from smadrive.display.colours import COOLING, HEATING
from smadrive.display.line_plot import Curve, line_plot
from smadrive.errors import DataError, ModelError
from smadrive.files.number_text import shortened
from smadrive.numerics.arrays import FloatArray, finite_array, float_array
from smadrive.numerics.scalars import real_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from smadrive.hysteresis.certificate import Certificate
    from smadrive.hysteresis.turning_points import Memory


LOOP_POINTS = 200
"""Points of each branch in the plot of a model."""


class HysteresisState(NamedTuple):
    """Input v, output y and normalised state w of one wire.

    `memory` is None for a model without memory. Otherwise see `Memory` in turning_points.py.
    """

    v: float
    y: float
    w: float
    memory: Memory | None = None


class HysteresisModel(ABC):
    """The base class of all hysteresis models. `input_range` is the range of v, and y = offset + scale · w."""

    def __init__(self, scale: float, offset: float, input_range: tuple[float, float]) -> None:
        self.scale = scale
        self.offset = offset
        self.input_range = input_range

    @abstractmethod
    def admissible(self, v: float) -> tuple[float, float]:
        """Return the smallest and the largest state w that the model can have at input v."""

    @abstractmethod
    def certificate(self) -> Certificate:
        """Return the proven properties of this model: contraction, boundedness, where the inverse is unique."""

    @abstractmethod
    def branch(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return the state w at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""

    @abstractmethod
    def branch_slope(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return dw/dv at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""

    @abstractmethod
    def reach(self, state: HysteresisState, w: float) -> HysteresisState:
        """Return the state at which a wire that moves from `state` reaches the normalised state w.

        The input moves in one direction only. If no input of the range leads to w, the result is the state at the end
        of the range.
        """

    @abstractmethod
    def corrected(self, state: HysteresisState, v: float, y: float) -> HysteresisState:
        """Return `state` with its input replaced by the estimate v, and its output by the estimate y.

        The model makes no step. If the model cannot take the output y at v, the output of the result differs from y.
        """

    @abstractmethod
    def _on_branch(self, v: float) -> HysteresisState:
        """Return the state on the heating branch at input v."""

    @abstractmethod
    def _between(self, v: float, w: float) -> HysteresisState:
        """Return the state with the input v and the admissible state w."""

    @abstractmethod
    def _moved(self, state: HysteresisState, v: float) -> HysteresisState:
        """Return the state after the input has moved monotonically to v, a finite number."""

    @abstractmethod
    def _trajectory(self, v: FloatArray, start: HysteresisState, out: FloatArray) -> None:
        """Write the states w along the path `v` (samples,) to `out`. The path begins in the state `start`."""

    def simulate(self, v: ArrayLike, y0: ArrayLike | None = None) -> FloatArray:
        """Return the outputs y along an input path `v`, shape (samples,) or (samples, wires).

        `y0` is the output at v[0], one number or one number per wire; without `y0` the wires start on the heating
        branch. An output that the model cannot have at v[0] is replaced by the nearest possible output. Raises
        DataError for other shapes, and for values that are not finite.
        """
        path = finite_array("input v", v)
        columns = path.reshape(len(path), -1)
        starts = self._start_states(columns[0], y0)
        states = np.empty(columns.shape, order="F")
        for wire, start in enumerate(starts):
            self._trajectory(np.ascontiguousarray(columns[:, wire]), start, states[:, wire])
        states *= self.scale
        states += self.offset
        return states.reshape(path.shape)

    def _start_states(self, v0: FloatArray, y0: ArrayLike | None) -> list[HysteresisState]:
        if y0 is None:
            return [self.initial_state(v) for v in v0.tolist()]
        outputs = finite_array("initial output y0", np.atleast_1d(float_array("initial output y0", y0)))
        if outputs.size not in (1, len(v0)):
            cure = "pass one number or one per wire"
            raise DataError(
                "not one value per wire", where="y0", value=f"{outputs.size} values, {len(v0)} wires", cure=cure
            )
        outputs = np.broadcast_to(outputs.ravel(), (len(v0),))
        return [self.initial_state(v, y) for v, y in zip(v0.tolist(), outputs.tolist(), strict=True)]

    def initial_state(self, v0: float, y: float | None = None) -> HysteresisState:
        """Return the state at input v0 with output y; without y the state on the heating branch.

        An output that the model cannot have at v0 is replaced by the nearest possible output. Raises DataError when v0
        or y is not a finite number.
        """
        where = "initial state (v0, y)"
        if not (
            isfinite(real_number(v0, where, DataError)) and (y is None or isfinite(real_number(y, where, DataError)))
        ):
            raise DataError("not finite", where=where, value=(v0, y))
        v0 = float(v0)
        return self._on_branch(v0) if y is None else self._between(v0, self._admitted(v0, y))

    def adopted(self, state: HysteresisState, of: HysteresisModel) -> HysteresisState:
        """Return the state in this model of a wire that is at `state` in the model `of`.

        The input stays, and so does the output if this model can have it. If both models have memory, the input runs
        through its turning points again, because the wire still remembers them.
        """
        if of is self:
            return state
        low, high = self.input_range
        replayed = self._on_branch(low)
        if state.memory is None or replayed.memory is None:
            return self.initial_state(state.v, state.y)
        for turn in (*state.memory.turns[1:], state.v):
            replayed = self._moved(replayed, min(max(turn, low), high))
        return self.corrected(replayed, state.v, state.y)

    def _admitted(self, v: float, y: float) -> float:
        """Return the state w of the output y, or the nearest state that the model can have at input v."""
        low, high = self.admissible(v)
        return min(max(float((y - self.offset) / self.scale), low), high)

    def step(self, state: HysteresisState, v1: float) -> HysteresisState:
        """Return the state after the input has moved monotonically from state.v to v1, exact for any distance.

        Raises DataError when v1 is not finite.
        """
        v1 = float(v1)
        if not isfinite(v1):
            raise DataError("not finite", where="input of the step", value=v1)
        return self._moved(state, v1)

    @abstractmethod
    def slope(self, state: HysteresisState, direction: int) -> float:
        """Return dy/dv at the state, for an input that rises (direction > 0) or falls."""

    def facts(self) -> list[tuple[str, str]]:
        """Return the main properties of the model for display, as pairs of a name and a text."""
        (low, high), certificate = self.input_range, self.certificate()
        ends = sorted(round(self.initial_state(end).y / self.scale, 9) * self.scale for end in (low, high))
        verdict = "yes" if certificate.holds else f"no: {', '.join(certificate.shortcomings)}"
        return [
            ("kind", type(self).__name__),
            *([("rules", str(len(self.rules)))] if hasattr(self, "rules") else []),
            ("input", f"{low:.4g} to {high:.4g}"),
            ("output", f"{ends[0]:.4g} to {ends[1]:.4g}"),
            ("certified", verdict),
        ]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name} {value}' for name, value in self.facts()[1:])})"

    def _repr_html_(self) -> str:
        return card("Hysteresis model", self.facts(), loop_plot(self))


def loop_plot(model: HysteresisModel, input_name: str = "input", output_name: str = "output") -> str:
    """Return the major loop of `model` as inline SVG."""
    low, high = model.input_range
    rising = np.linspace(low, high, LOOP_POINTS)
    outputs = model.simulate(np.concatenate((rising, rising[::-1])))
    heating, cooling = outputs[:LOOP_POINTS], outputs[LOOP_POINTS:]
    return line_plot(
        [
            Curve(rising.tolist(), heating.tolist(), "heating", HEATING),
            Curve(rising[::-1].tolist(), cooling.tolist(), "cooling", COOLING),
        ],
        input_name,
        output_name,
    )


def check_output_map(scale: float, offset: float, input_range: tuple[float, float]) -> tuple[float, float]:
    """Check scale, offset and input range of a model, and return the two ends of the range as floats.

    Raises ModelError for values that are not finite numbers, for the scale 0, and for a range that does not increase.
    """
    if not isfinite(real_number(scale, "scale", ModelError)) or scale == 0:
        cure = "give a positive scale, or a negative one when the output falls on heating"
        raise ModelError("zero or not finite", where="scale", value=scale, cure=cure)
    if not isfinite(real_number(offset, "offset", ModelError)):
        raise ModelError("not finite", where="offset", value=offset)
    lower, upper = _range_ends(input_range)
    if not (isfinite(lower) and isfinite(upper) and lower < upper):
        cure = "give the lower end first, both ends finite"
        raise ModelError("not an increasing range", where="input_range", value=(lower, upper), cure=cure)
    return lower, upper


def _range_ends(input_range: object) -> tuple[float, float]:
    """Return the two ends of the range as floats. ModelError unless `input_range` consists of two numbers."""
    if not isinstance(input_range, Sequence | np.ndarray) or len(input_range) != 2:
        cure = "pass the lower and the upper end"
        raise ModelError("not two numbers", where="input_range", value=shortened(input_range), cure=cure)
    lower, upper = (real_number(end, "input_range", ModelError) for end in input_range)
    return lower, upper
