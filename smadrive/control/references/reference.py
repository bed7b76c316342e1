"""The displacement setpoint as a function of time.

A reference is a piecewise linear table in time, given by its samples or by a shape (see shapes). `with_approach` puts a
smooth path before it, from the present displacement to the beginning of the reference. The metrics leave the approach
out.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smadrive.display.card import card
from smadrive.display.line_plot import Curve, line_plot
from smadrive.errors import ConfigError, DataError
from smadrive.numerics.piecewise_linear import PiecewiseLinear

Array = NDArray[np.float64]

TABLE_STEP_S = 0.02
"""Step of the tables of curved shapes: at most a loop period, with errors below that of any thermocouple."""

LONGEST_S = 86_400.0
"""A day. At 20 Hz its feasibility check takes some three minutes and 1.3 GB; both grow with the length."""

SHORTEST_S = 0.1
"""The shortest reference, and the shortest swing: every wire is slower."""

FARTHEST_MM = 1e5
"""The length of the longest wire that a wire file may describe."""

TRAVEL_SLACK = 0.005
"""Share of the travel by which a reference may exceed it: the noise of the sensor that measured the travel."""


@dataclass(frozen=True, repr=False)
class Reference:
    """Displacement setpoint over time; the approach ends, and the metrics begin, at `scored_from_s`.

    An `endless` reference continues there whenever its table has ended.
    """

    times_s: Array
    displacement_mm: Array
    scored_from_s: float = 0.0
    endless: bool = False

    @classmethod
    def from_samples(cls, times_s: ArrayLike, displacement_mm: ArrayLike) -> Reference:
        """The reference through the samples, with straight lines between them.

        DataError for NaN, lengths that differ, time that does not increase, less than `SHORTEST_S` or more than
        `LONGEST_S`, and values beyond `FARTHEST_MM`.
        """
        times = np.asarray(times_s, dtype=np.float64)
        values = np.asarray(displacement_mm, dtype=np.float64)
        if times.shape != values.shape or times.ndim != 1 or times.size < 2:
            raise DataError(f"reference: needs two columns of one length >= 2, got {times.shape} and {values.shape}")
        for name, column in (("time_s", times), ("displacement_mm", values)):
            bad = np.flatnonzero(~np.isfinite(column))
            if bad.size:
                raise DataError(
                    f"reference: {name} of sample {bad[0] + 1} is {column[bad[0]]}: every value must be finite"
                )
        farthest = int(np.argmax(np.abs(values)))
        check_displacement(f"displacement_mm of sample {farthest + 1}", float(values[farthest]))
        check_length(float(times.max()) - float(times.min()))
        backwards = np.flatnonzero(np.diff(times) <= 0)
        if backwards.size:
            n = int(backwards[0])
            raise DataError(f"reference: time goes from {times[n]:g} s to {times[n + 1]:g} s: it must increase")
        return cls(times - times[0], values)

    def __repr__(self) -> str:
        low_mm, high_mm = float(self.displacement_mm.min()), float(self.displacement_mm.max())
        length = "endless" if self.endless else f"{self.duration_s:.4g} s"
        return f"Reference({length}, {low_mm:.4g} to {high_mm:.4g} mm)"

    def _repr_html_(self) -> str:
        setpoint = Curve(self.times_s.tolist(), self.displacement_mm.tolist(), "setpoint", "#1d6fb8")
        return card(repr(self), (), line_plot([setpoint], "time / s", "displacement / mm"))

    @property
    def duration_s(self) -> float:
        """Length of the reference, approach included."""
        return inf if self.endless else float(self.times_s[-1])

    @property
    def cycle_s(self) -> float:
        """Length of the table without the approach."""
        return float(self.times_s[-1]) - self.scored_from_s

    def cycle(self, time_s: float) -> int:
        """The number of cycles that an endless reference has completed."""
        return max(0, int((time_s - self.scored_from_s) // self.cycle_s)) if self.endless else 0

    def value_mm(self, time_s: float) -> float:
        """The setpoint at `time_s`, mm; before and after the table its first and its last value."""
        return self._table.at(time_s - self._begun_s(time_s))

    @cached_property
    def _table(self) -> PiecewiseLinear:
        return PiecewiseLinear(self.times_s.tolist(), self.displacement_mm.tolist())

    @cached_property
    def _reversals(self) -> tuple[list[float], list[float]]:
        """Times and new directions of the reversals; of an endless reference those of two cycles."""
        times, values = self.times_s, self.displacement_mm
        if self.endless:
            again = times > self.scored_from_s
            times = np.concatenate((times, times[again] + self.cycle_s))
            values = np.concatenate((values, values[again]))
        moves = np.sign(np.diff(values))
        moving = np.flatnonzero(moves)
        changes = moving[1:][moves[moving][1:] != moves[moving][:-1]]
        return times[changes].tolist(), moves[changes].tolist()

    def next_reversal_s(self, time_s: float, direction: int) -> float:
        """The time of the next reversal after `time_s`, against `direction`; inf when there is none."""
        times_s, directions = self._reversals
        begun_s = self._begun_s(time_s)
        for number in range(bisect_right(times_s, time_s - begun_s), len(times_s)):
            if directions[number] != direction:
                return begun_s + times_s[number]
        return inf

    def _begun_s(self, time_s: float) -> float:
        """The time by which the table, without the approach, is shifted at `time_s`."""
        return self.cycle(time_s) * self.cycle_s if self.endless else 0.0

    def check_within(self, ends_mm: tuple[float, float]) -> None:
        """ConfigError when the reference leaves the travel of the wire; its ends are `ends_mm`, in any order.

        The approach may leave it: it begins at the present displacement, and the wire follows it as far as it can.
        """
        low, high = min(ends_mm), max(ends_mm)
        slack = TRAVEL_SLACK * (high - low)
        scored_mm = self.displacement_mm[self.times_s >= self.scored_from_s]
        for name, value in (("lowest", scored_mm.min()), ("highest", scored_mm.max())):
            if not low - slack <= value <= high + slack:
                raise ConfigError(
                    f"reference: its {name} value is {value:.6g} mm; the identified wire reaches from {low:.6g} to "
                    f"{high:.6g} mm: keep the reference within"
                )

    def without_end(self, return_s: float) -> Reference:
        """The reference, repeated without end; if its ends differ, it returns to its beginning within `return_s`."""
        begins_mm, ends_mm = self.value_mm(self.scored_from_s), float(self.displacement_mm[-1])
        if begins_mm == ends_mm:
            return replace(self, endless=True)
        path_mm = _minimum_jerk(ends_mm, begins_mm, return_s)[1:]
        times_s = self.times_s[-1] + np.linspace(0.0, return_s, path_mm.size + 1)[1:]
        return Reference(
            np.concatenate((self.times_s, times_s)),
            np.concatenate((self.displacement_mm, path_mm)),
            self.scored_from_s,
            endless=True,
        )

    def with_approach(self, from_mm: float, approach_s: float) -> Reference:
        """The same reference after a minimum-jerk approach from `from_mm` lasting `approach_s`."""
        if approach_s <= 0:
            return self
        path_mm = _minimum_jerk(from_mm, float(self.displacement_mm[0]), approach_s)
        times_s = np.linspace(0.0, approach_s, path_mm.size)
        return Reference(
            np.concatenate((times_s[:-1], approach_s + self.times_s)),
            np.concatenate((path_mm[:-1], self.displacement_mm)),
            scored_from_s=approach_s,
        )


def _minimum_jerk(from_mm: float, to_mm: float, within_s: float) -> Array:
    """The smoothest path between two points at rest, tabulated."""
    s = np.linspace(0.0, 1.0, max(3, int(within_s / TABLE_STEP_S)))
    return from_mm + (to_mm - from_mm) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def check_displacement(name: str, value_mm: float) -> None:
    """DataError when the displacement exceeds the longest wire, or is NaN."""
    if not abs(value_mm) <= FARTHEST_MM:
        raise DataError(
            f"reference: {name} is {value_mm:g}, it must be finite and within {FARTHEST_MM:g} mm: is it in millimetres?"
        )


def check_length(duration_s: float, pieces: float = 0.0, longest_s: float = LONGEST_S) -> None:
    """DataError when a reference is shorter than `SHORTEST_S`, longer than `longest_s`, or has too many `pieces`.

    Call it before the table is made.
    """
    if duration_s < SHORTEST_S:
        raise DataError(
            f"reference: it lasts {duration_s:g} s, the shortest that can be run is {SHORTEST_S:g} s: "
            "slow it down; is its time in seconds?"
        )
    most = longest_s / TABLE_STEP_S
    if duration_s > longest_s:
        raise DataError(
            f"reference: it lasts {duration_s:g} s, the longest that can be run here is {longest_s:g} s: shorten it, "
            "or lower its cycles; is its time in seconds?"
        )
    if pieces > most:
        raise DataError(f"reference: it has {pieces:g} pieces, at most {most:g} can be here: lower their number")
