"""The displacement that is wanted, as a function of time.

A reference is a piecewise linear table in time. It is written `shape:key=value,...` (`parse_reference`) or read from a
CSV. An approach is put before it (`with_approach`): a smooth path from where the wire is to where the reference
begins, which is driven but not scored.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from inspect import Parameter, signature
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smadrive.errors import ConfigError, DataError
from smadrive.nearest import meant, nearest
from smadrive.polyline import Polyline

Array = NDArray[np.float64]

TABLE_STEP_S = 0.02
"""Curved shapes are tabulated this finely: below the error of any thermocouple, above any loop period in use."""

LONGEST_S = 86_400.0
"""A day: at 20 Hz its rehearsal takes some three minutes and 1.3 GB, and more with every second."""

SHORTEST_S = 0.1
"""No wire follows anything within less."""

MOST_PIECES = LONGEST_S / TABLE_STEP_S

TRAVEL_SLACK = 0.005
"""Share of the travel by which a reference may exceed it: the noise of the sensor that the travel was read with."""


@dataclass(frozen=True)
class Reference:
    """Wanted displacement over time; `scored_from_s` is where the approach ends and the figures begin.

    An `endless` one begins there again whenever its table has come to the end.
    """

    times_s: Array
    displacement_mm: Array
    scored_from_s: float = 0.0
    endless: bool = False

    @classmethod
    def from_samples(cls, times_s: ArrayLike, displacement_mm: ArrayLike) -> Reference:
        """Through the samples, straight between them.

        DataError for NaN, lengths that differ, time going backwards, less than `SHORTEST_S` and more than `LONGEST_S`.
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
        _check_length(float(times.max()) - float(times.min()))
        backwards = np.flatnonzero(np.diff(times) <= 0)
        if backwards.size:
            n = int(backwards[0])
            raise DataError(f"reference: time goes from {times[n]:g} s to {times[n + 1]:g} s: it must increase")
        if times[-1] - times[0] < SHORTEST_S:
            raise DataError(
                f"reference: it lasts {times[-1] - times[0]:g} s, the shortest that can be run is {SHORTEST_S:g} s: "
                "slow it down; is its time in seconds?"
            )
        return cls(times - times[0], values)

    @property
    def duration_s(self) -> float:
        """Length of the reference, approach included."""
        return inf if self.endless else float(self.times_s[-1])

    @property
    def cycle_s(self) -> float:
        """Length of the table without the approach."""
        return float(self.times_s[-1]) - self.scored_from_s

    def cycle(self, time_s: float) -> int:
        """How many times an endless reference has begun again."""
        return max(0, int((time_s - self.scored_from_s) // self.cycle_s)) if self.endless else 0

    def value_mm(self, time_s: float) -> float:
        """Wanted displacement at `time_s`; the ends are held."""
        return self._table.at(time_s - self._begun_s(time_s))

    @cached_property
    def _table(self) -> Polyline:
        return Polyline(self.times_s.tolist(), self.displacement_mm.tolist())

    @cached_property
    def _turns(self) -> tuple[list[float], list[float]]:
        """When the reference begins to move the other way, and in which direction; an endless one in two cycles."""
        times, values = self.times_s, self.displacement_mm
        if self.endless:
            again = times > self.scored_from_s
            times = np.concatenate((times, times[again] + self.cycle_s))
            values = np.concatenate((values, values[again]))
        moves = np.sign(np.diff(values))
        moving = np.flatnonzero(moves)
        changes = moving[1:][moves[moving][1:] != moves[moving][:-1]]
        return times[changes].tolist(), moves[changes].tolist()

    def next_turn_s(self, time_s: float, direction: int) -> float:
        """When, after `time_s`, the reference next begins to move against `direction`; inf when it does not."""
        times_s, directions = self._turns
        begun_s = self._begun_s(time_s)
        for number in range(bisect_right(times_s, time_s - begun_s), len(times_s)):
            if directions[number] != direction:
                return begun_s + times_s[number]
        return inf

    def _begun_s(self, time_s: float) -> float:
        """How much later than at first the table, without the approach, runs at `time_s`."""
        return self.cycle(time_s) * self.cycle_s if self.endless else 0.0

    def check_within(self, ends_mm: tuple[float, float]) -> None:
        """ConfigError when the reference leaves the wire's travel, whose two ends are `ends_mm` in either order.

        Its approach may: it begins where the wire was, and is followed as far as the wire reaches.
        """
        low, high = min(ends_mm), max(ends_mm)
        slack = TRAVEL_SLACK * (high - low)
        scored_mm = self.displacement_mm[self.times_s >= self.scored_from_s]
        for name, value in (("lowest", scored_mm.min()), ("highest", scored_mm.max())):
            if not low - slack <= value <= high + slack:
                raise ConfigError(
                    f"reference: its {name} value is {value:.3g} mm; the identified wire reaches from {low:.3g} to "
                    f"{high:.3g} mm: keep the reference within"
                )

    def without_end(self, return_s: float) -> Reference:
        """The same reference again and again; one that does not end where it begins returns within `return_s`."""
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
    """The smoothest way between two points at rest, tabulated."""
    s = np.linspace(0.0, 1.0, max(3, int(within_s / TABLE_STEP_S)))
    return from_mm + (to_mm - from_mm) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def parse_reference(spec: str) -> Reference:
    """A reference from its one-line form, e.g. `sine:low_mm=2,high_mm=9,period_s=56,cycles=2`.

    Shapes and their keys are the functions of this file; ConfigError names what is unknown or missing, and what there
    is: the shapes, or the keys.
    """
    shape, _, arguments = spec.partition(":")
    make = SHAPES.get(shape)
    if make is None:
        raise ConfigError(f"reference '{spec}': '{shape}' is neither a shape nor a CSV file{nearest(shape, SHAPES)}")
    pairs = [part.partition("=") for part in arguments.split(",") if part]
    given = {key.strip(): value for key, _, value in pairs}
    keys = signature(make).parameters
    wrong = _wrong_keys(given, keys)
    if wrong:
        told = ", ".join(_told(key) for key in keys.values())
        raise ConfigError(f"reference '{spec}': {wrong}; the keys of '{shape}' are {told}")
    try:
        return make(**{key: float(value) for key, value in given.items()})
    except ValueError as error:
        raise ConfigError(f"reference '{spec}': {error}") from None


def _wrong_keys(given: Collection[str], keys: Mapping[str, Parameter]) -> str:
    """What is wrong with the keys that were given; nothing: empty."""
    for key in given:
        if key not in keys:
            return f"unknown key '{key}'{meant(key, keys)}"
    missing = [name for name, key in keys.items() if key.default is key.empty and name not in given]
    return f"missing: {', '.join(missing)}" if missing else ""


def _told(key: Parameter) -> str:
    return f"{key.name}=" if key.default is key.empty else f"{key.name}= (optional: {key.default:g})"


def sine(*, low_mm: float, high_mm: float, period_s: float, cycles: float = 2.0) -> Reference:
    """A sine between `low_mm` and `high_mm` that begins at `low_mm`."""
    _check_length(period_s * cycles)
    times = np.linspace(0.0, period_s * cycles, max(3, int(period_s * cycles / TABLE_STEP_S)))
    swing = 0.5 * (1.0 - np.cos(2.0 * np.pi * times / _positive("period_s", period_s)))
    return Reference.from_samples(times, low_mm + (high_mm - low_mm) * swing)


def triangle(*, low_mm: float, high_mm: float, period_s: float, cycles: float = 2.0) -> Reference:
    """Straight up and down between `low_mm` and `high_mm`."""
    _check_length(period_s * cycles, 2 * cycles)
    corners = np.arange(int(2 * cycles) + 1)
    values = np.where(corners % 2 == 0, low_mm, high_mm)
    return Reference.from_samples(corners * 0.5 * _positive("period_s", period_s), values)


def staircase(
    *, low_mm: float, high_mm: float, steps: float = 4.0, dwell_s: float = 10.0, rise_s: float = 2.0
) -> Reference:
    """`steps` equal levels up and down again, each held `dwell_s`, with straight rises of `rise_s` between them."""
    _check_length(2 * steps * (dwell_s + rise_s), 2 * steps)
    count = int(_positive("steps", steps))
    up = np.linspace(low_mm, high_mm, count + 1)
    levels = np.concatenate((up, up[-2::-1]))
    starts = np.arange(levels.size) * (_positive("dwell_s", dwell_s) + _positive("rise_s", rise_s))
    times = np.column_stack((starts, starts + dwell_s)).ravel()
    return Reference.from_samples(times, np.repeat(levels, 2))


def steps(*, low_mm: float, high_mm: float, dwell_s: float = 10.0, cycles: float = 2.0) -> Reference:
    """Jumps up and down between `low_mm` and `high_mm`, each held `dwell_s`: for a wire, to be smoothed before."""
    _check_length(2 * cycles * dwell_s, 2 * cycles)
    levels = np.where(np.arange(int(2 * _positive("cycles", cycles)) + 1) % 2 == 0, low_mm, high_mm)
    starts = np.arange(levels.size) * _positive("dwell_s", dwell_s)
    times = np.column_stack((starts, starts + dwell_s - TABLE_STEP_S)).ravel()
    return Reference.from_samples(times, np.repeat(levels, 2))


def trapezoid(
    *, low_mm: float, high_mm: float, rise_s: float = 10.0, dwell_s: float = 5.0, cycles: float = 2.0
) -> Reference:
    """Straight up within `rise_s`, held `dwell_s`, straight down, held as long."""
    _check_length(2 * cycles * (dwell_s + rise_s), 2 * cycles)
    levels = np.where(np.arange(int(2 * _positive("cycles", cycles)) + 1) % 2 == 0, low_mm, high_mm)
    starts = np.arange(levels.size) * (_positive("dwell_s", dwell_s) + _positive("rise_s", rise_s))
    times = np.column_stack((starts, starts + dwell_s)).ravel()
    return Reference.from_samples(times, np.repeat(levels, 2))


def chirp(*, low_mm: float, high_mm: float, start_hz: float, end_hz: float, duration_s: float = 120.0) -> Reference:
    """A swing between `low_mm` and `high_mm` whose frequency rises evenly from `start_hz` to `end_hz`."""
    _check_length(duration_s)
    rate_hz_per_s = (_positive("end_hz", end_hz) - _positive("start_hz", start_hz)) / _positive(
        "duration_s", duration_s
    )
    times = np.linspace(0.0, duration_s, max(3, int(duration_s / TABLE_STEP_S)))
    turns = (start_hz + 0.5 * rate_hz_per_s * times) * times
    return Reference.from_samples(times, low_mm + (high_mm - low_mm) * 0.5 * (1.0 - np.cos(2.0 * np.pi * turns)))


def _check_length(duration_s: float, pieces: float = 0.0) -> None:
    """DataError when a reference lasts too long to be rehearsed, or has too many pieces; before its table is made."""
    if duration_s > LONGEST_S:
        raise DataError(
            f"reference: it lasts {duration_s:g} s, the longest that is rehearsed and run at once is {LONGEST_S:g} s, "
            "a day: shorten it; is its time in seconds?"
        )
    if pieces > MOST_PIECES:
        raise DataError(f"reference: it has {pieces:g} pieces, at most {MOST_PIECES:g} can be: lower their number")


def _positive(name: str, value: float) -> float:
    if value > 0:
        return value
    raise ConfigError(f"reference: {name} must be positive, it is {value:g}")


SHAPES: dict[str, Callable[..., Reference]] = {
    make.__name__: make for make in (sine, triangle, trapezoid, steps, staircase, chirp)
}
