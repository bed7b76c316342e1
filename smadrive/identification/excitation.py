"""The temperature path of an identification experiment.

A major loop alone cannot tell a rule's a from its b: on each branch w is then a function of v. So after two major
loops the path turns inside the loop: nested reversals around the middle that shrink towards it, first approached from
below, then from above, so that heating and cooling curves start from every depth of transformation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import ConfigError
from smadrive.measurement import Measurement
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.wire.heat_balance import HeatBalance

LONGEST_S = 86_400.0
"""A day: its log is of some 200 MB at 20 Hz, and no wire is so slow."""

SPARE = 1.15
"""Heating and cooling of the nominal wire must exceed what the path asks for by this factor."""


@dataclass(frozen=True)
class ExcitationRecord:
    """What was measured during an excitation: five columns of one length.

    Current and voltage of a sample are those of the period that ends with it.
    """

    time_s: NDArray[np.float64]
    current_a: NDArray[np.float64]
    voltage_v: NDArray[np.float64]
    temperature_c: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]


@dataclass(frozen=True)
class Excitation:
    """A piecewise linear temperature path through `turning_points_c` at constant rate.

    `rate_c_per_s` should be within what the wire can cool at its lowest turning point: else the path waits there.
    """

    turning_points_c: tuple[float, ...]
    rate_c_per_s: float

    def __post_init__(self) -> None:
        """Refuse a path that stands still, or as good as: one of more than `LONGEST_S`."""
        if not self.rate_c_per_s > 0:
            raise ConfigError(f"excitation: rate_c_per_s must be positive, it is {self.rate_c_per_s:g}")
        travel_k = sum(abs(after - before) for before, after in pairwise(self.turning_points_c))
        if travel_k > LONGEST_S * self.rate_c_per_s:
            raise ConfigError(
                f"excitation: at rate_c_per_s = {self.rate_c_per_s:g} its {travel_k:.0f} K last "
                f"{travel_k / self.rate_c_per_s:.2g} s, the longest is {LONGEST_S:g} s, a day: raise rate_c_per_s to "
                "some kelvins per second; is it in K/s?"
            )

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """When each turning point is reached."""
        legs = np.abs(np.diff(np.asarray(self.turning_points_c))) / self.rate_c_per_s
        return np.concatenate(([0.0], np.cumsum(legs)))

    @property
    def duration_s(self) -> float:
        """Length of the experiment."""
        return float(self.times_s[-1])

    def temperature_c(self, time_s: float) -> float:
        """The wanted temperature at `time_s` after the start; the last turning point afterwards."""
        return self._path_c.at(time_s)

    @cached_property
    def _path_c(self) -> PiecewiseLinear:
        return PiecewiseLinear(self.times_s.tolist(), self.turning_points_c)


def check_may_excite(excitation: Excitation, balance: HeatBalance, current_max_a: float, found: Measurement) -> None:
    """Preconditions of the experiment, for the nominal wire as it is `found`. ConfigError names the cure.

    The displacement must be measured; the largest current must reach the highest temperature at the wanted rate, and
    the wire must cool at that rate where it is slowest, at the lowest, both with `SPARE` to spare.
    """
    if not isfinite(found.displacement_mm):
        raise ConfigError(
            "excitation: no displacement is measured, without which no hysteresis can be identified: "
            "connect a sensor, and give its device in the rig file"
        )
    inner = excitation.turning_points_c[1:]
    low_c, high_c, rate = min(inner), max(inner), excitation.rate_c_per_s
    needed_w = SPARE * balance.power_w(high_c, rate, 0.0)
    needed_a = balance.current_a(needed_w, 1.0)
    if needed_a > current_max_a:
        raise ConfigError(
            f"excitation: {high_c:g} °C at {rate:g} K/s take about {needed_a:.2f} A, "
            f"current_max_a = {current_max_a:g}: lower high_c or rate_c_per_s, or raise the limit where the wire's "
            "data sheet allows it"
        )
    cools_c_per_s = (low_c - balance.ambient_c) / balance.time_constant_s / SPARE
    if cools_c_per_s < rate:
        reached_c = balance.ambient_c + SPARE * rate * balance.time_constant_s
        raise ConfigError(
            f"excitation: at low_c = {low_c:g} °C the wire cools no faster than {cools_c_per_s:.2g} K/s, the path "
            f"falls at {rate:g} K/s: raise low_c to {reached_c:.0f}, or lower rate_c_per_s"
        )


def nested_reversals(
    low_c: float, high_c: float, rate_c_per_s: float, start_c: float, *, major_loops: int = 2, reversals: int = 5
) -> Excitation:
    """Major loops between `low_c` and `high_c`, then `reversals` shrinking loops from below and from above.

    The path starts at `start_c` (the wire as it is found). Raises ConfigError when `high_c` does not exceed `low_c`.
    """
    if not high_c > low_c:
        raise ConfigError(f"excitation: high_c ({high_c:g}) must exceed low_c ({low_c:g})")
    points = [start_c, *[high_c, low_c] * major_loops]
    middle_c = 0.5 * (low_c + high_c)
    shrinking = [(high_c - middle_c) * (reversals - n) / (reversals + 1) for n in range(reversals)]
    for half_c in shrinking:
        points += [middle_c + half_c, middle_c - half_c]
    points += [low_c, high_c]
    for half_c in shrinking:
        points += [middle_c - half_c, middle_c + half_c]
    return Excitation((*points, high_c, low_c), rate_c_per_s)
