"""The displacement setpoint as a function of time.

A reference is a piecewise linear table in time, given by its samples or by a shape (see shapes.py). `with_approach`
puts a smooth path before the reference, from the present displacement to its beginning. The metrics do not count this
approach.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isclose

import numpy as np
from numpy.typing import ArrayLike

from smadrive.control.references.limits import (
    LONGEST_REPEATED_S,
    TABLE_STEP_S,
    WHERE,
    check_displacement,
    check_length,
)
from smadrive.display.card import card
from smadrive.display.line_plot import INK, Curve, line_plot
from smadrive.errors import ConfigError, DataError
from smadrive.numerics.arrays import FloatArray, float_array
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.numerics.scalars import whole_number

CLOSED_MM = 1e-6
"""A reference whose ends differ by less than this, mm, needs no way back before it is repeated."""

TRAVEL_SLACK = 0.005
"""A reference may exceed the travel of the wire by this share, because the measured travel contains sensor noise."""


@dataclass(frozen=True, repr=False)
class Reference:
    """Displacement setpoint over time, as a table with straight lines between its samples.

    At `scored_from_s` the approach ends and the metrics begin. At the end of its table, an `endless` reference
    continues at `scored_from_s`. With `repeats` above 1 the reference does the same until it has made this number of
    cycles.
    """

    times_s: FloatArray
    displacement_mm: FloatArray
    scored_from_s: float = 0.0
    endless: bool = False
    repeats: int = 1

    def __post_init__(self) -> None:
        """Make arrays of the columns. DataError when they are not numbers."""
        for name in ("times_s", "displacement_mm"):
            object.__setattr__(self, name, float_array(f"{WHERE}: {name}", getattr(self, name)))

    @classmethod
    def from_samples(cls, times_s: ArrayLike, displacement_mm: ArrayLike) -> Reference:
        """Return the reference through the samples, with straight lines between them.

        DataError for a value that is not a finite number, for a displacement beyond ± `FARTHEST_MM`, for columns of
        different lengths, for a time that does not increase, and for a reference shorter than `SHORTEST_S` or longer
        than `LONGEST_S`.
        """
        times = float_array(f"{WHERE}: time_s", times_s)
        values = float_array(f"{WHERE}: displacement_mm", displacement_mm)
        if times.shape != values.shape or times.ndim != 1 or times.size < 2:
            raise DataError(
                "needs two columns of the same length, with 2 samples at least",
                where=WHERE,
                value=_sizes(times, values),
                cure="pass one displacement for each time",
            )
        for name, column in (("time_s", times), ("displacement_mm", values)):
            bad = np.flatnonzero(~np.isfinite(column))
            if bad.size:
                where, cure = f"{WHERE}: {name} of sample {bad[0] + 1}", "correct or remove the sample"
                raise DataError("not finite", where=where, value=float(column[bad[0]]), cure=cure)
        farthest = int(np.argmax(np.abs(values)))
        check_displacement(f"displacement_mm of sample {farthest + 1}", float(values[farthest]))
        check_length(float(times.max()) - float(times.min()))
        backwards = np.flatnonzero(np.diff(times) <= 0)
        if backwards.size:
            n = int(backwards[0])
            raise DataError(
                "not later than the previous sample",
                where=f"{WHERE}: time_s of sample {n + 2}",
                value=f"{times[n + 1]:g} s",
                limit=f"{times[n]:g} s",
                cure="sort the samples by time",
            )
        return cls(times - times[0], values)

    def __repr__(self) -> str:
        low_mm, high_mm = float(self.displacement_mm.min()), float(self.displacement_mm.max())
        length = "endless" if self.endless else f"{self.duration_s:.4g} s"
        return f"Reference({length}, {low_mm:.4g} to {high_mm:.4g} mm)"

    def _repr_html_(self) -> str:
        setpoint = Curve(self.times_s.tolist(), self.displacement_mm.tolist(), "setpoint", INK)
        return card(repr(self), (), line_plot([setpoint], "time / s", "displacement / mm"))

    @cached_property
    def duration_s(self) -> float:
        """Duration of the reference in s, including the approach and all cycles; infinite for an endless reference."""
        return inf if self.endless else float(self.times_s[-1]) + (self.repeats - 1) * self.cycle_s

    @cached_property
    def cycle_s(self) -> float:
        """Duration of the table without the approach, s."""
        return float(self.times_s[-1]) - self.scored_from_s

    def cycle(self, time_s: float) -> int:
        """Return the number of the cycle at `time_s`, counted from 0; 0 for a reference that is not repeated."""
        number = max(0, int((time_s - self.scored_from_s) // self.cycle_s))
        return number if self.endless else min(number, self.repeats - 1)

    def value_mm(self, time_s: float) -> float:
        """Return the setpoint at `time_s`, mm.

        Before its table, a reference keeps its first value. After its table or its last cycle, it keeps its last value.
        """
        return self._table.at(time_s - self._begun_s(time_s))

    @cached_property
    def _table(self) -> PiecewiseLinear:
        return PiecewiseLinear(self.times_s.tolist(), self.displacement_mm.tolist())

    @cached_property
    def _reversals(self) -> tuple[list[float], list[float]]:
        """Return the times of the reversals and the directions after them, of two cycles of a repeated reference."""
        times, values = self.times_s, self.displacement_mm
        if self.endless or self.repeats > 1:
            again = times > self.scored_from_s
            times = np.concatenate((times, times[again] + self.cycle_s))
            values = np.concatenate((values, values[again]))
        moves = np.sign(np.diff(values))
        moving = np.flatnonzero(moves)
        changes = moving[1:][moves[moving][1:] != moves[moving][:-1]]
        return times[changes].tolist(), moves[changes].tolist()

    def next_reversal_s(self, time_s: float, direction: int) -> float:
        """Return the time of the next reversal that ends a movement in `direction` (+1 or -1), s.

        The reversal is later than `time_s`. The result is infinite if no such reversal follows.
        """
        times_s, directions = self._reversals
        begun_s = self._begun_s(time_s)
        for number in range(bisect_right(times_s, time_s - begun_s), len(times_s)):
            if directions[number] != direction:
                found_s = begun_s + times_s[number]
                return found_s if found_s < self.duration_s else inf
        return inf

    def _begun_s(self, time_s: float) -> float:
        """Return the duration of the cycles that are completed at `time_s`."""
        return self.cycle(time_s) * self.cycle_s if self.endless or self.repeats > 1 else 0.0

    @property
    def scored_mm(self) -> FloatArray:
        """The displacements after the approach, mm."""
        return self.displacement_mm[self.times_s >= self.scored_from_s]

    def check_within(self, ends_mm: tuple[float, float]) -> None:
        """Raise ConfigError when the reference leaves the travel of the wire.

        `ends_mm` are the displacements at the two ends of the travel. The approach may leave the travel: it begins at
        the present displacement, which the model may not reach.
        """
        low, high = min(ends_mm), max(ends_mm)
        slack = TRAVEL_SLACK * (high - low)
        for name, value in (("lowest", self.scored_mm.min()), ("highest", self.scored_mm.max())):
            if not low - slack <= value <= high + slack:
                raise ConfigError(
                    "outside the travel of the identified wire",
                    where=f"{WHERE}: {name} value",
                    value=f"{round(value, 3):g} mm",
                    limit=f"{round(low, 3):g} to {round(high, 3):g} mm",
                    cure="keep the reference within this travel",
                )

    def without_end(self, return_s: float) -> Reference:
        """Return the same reference, repeated without end.

        If its ends differ, each cycle ends with a smooth way back that lasts `return_s`.
        """
        begins_mm, ends_mm = self.value_mm(self.scored_from_s), float(self.displacement_mm[-1])
        if isclose(begins_mm, ends_mm, abs_tol=CLOSED_MM):
            return replace(self, endless=True)
        path_mm = _minimum_jerk(ends_mm, begins_mm, return_s)[1:]
        times_s = self.times_s[-1] + np.linspace(0.0, return_s, path_mm.size + 1)[1:]
        return Reference(
            np.concatenate((self.times_s, times_s)),
            np.concatenate((self.displacement_mm, path_mm)),
            self.scored_from_s,
            endless=True,
        )

    def repeated(self, repeats: int, return_s: float) -> Reference:
        """Return the same reference, repeated `repeats` times.

        If its ends differ, each cycle ends with a smooth way back that lasts `return_s`.

        ConfigError unless `repeats` is a whole number above 0, and for a reference that is repeated already. DataError
        when all cycles together last longer than `LONGEST_REPEATED_S`.
        """
        whole_number(repeats, "repeats", "cycles", 1)
        if self.repeats > 1:
            cure = "repeat the reference of one cycle"
            raise ConfigError("is repeated already", where=WHERE, value=f"{self.repeats} cycles", cure=cure)
        cycles = replace(self.without_end(return_s), endless=False, repeats=repeats)
        check_length(cycles.duration_s, longest_s=LONGEST_REPEATED_S)
        return cycles

    def with_approach(self, from_mm: float, approach_s: float) -> Reference:
        """Return this reference with all its cycles after a minimum-jerk approach.

        The approach begins at the displacement `from_mm` and lasts `approach_s`. Without a duration above 0, the result
        is this reference itself.
        """
        if approach_s <= 0:
            return self
        path_mm = _minimum_jerk(from_mm, float(self.displacement_mm[0]), approach_s)
        times_s = np.linspace(0.0, approach_s, path_mm.size)
        return replace(
            self,
            times_s=np.concatenate((times_s[:-1], approach_s + self.times_s)),
            displacement_mm=np.concatenate((path_mm[:-1], self.displacement_mm)),
            scored_from_s=approach_s + self.scored_from_s,
        )


MOST_ROWS = 5000
"""With this number of rows, the straight lines of its table differ from a minimum-jerk path by 3e-8 of its length."""


def _sizes(times: FloatArray, values: FloatArray) -> str:
    """Return the lengths of both columns as text, or their shapes if a column has more than one dimension."""
    if times.ndim == values.ndim == 1:
        return f"{times.size} times and {values.size} displacements"
    return f"shapes {times.shape} and {values.shape}"


def _minimum_jerk(from_mm: float, to_mm: float, within_s: float) -> FloatArray:
    """Return a table of the smoothest (minimum-jerk) path between two points at rest, at most `MOST_ROWS` rows."""
    s = np.linspace(0.0, 1.0, max(3, int(min(within_s / TABLE_STEP_S, MOST_ROWS))))
    return from_mm + (to_mm - from_mm) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
