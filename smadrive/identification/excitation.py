"""The temperature path of an identification experiment, and its record.

The plans in `excitation_plans.py` choose the turning points of the path.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from smadrive.errors import ConfigError
from smadrive.measurement import Measurement
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.wire.cold_wire import CHECK_CALIBRATION, COLD_WIRE_K, is_too_cold
from smadrive.wire.heat_balance import HeatBalance

LONGEST_S = 86_400.0
"""The longest excitation: a day. Every wire needs less. At 20 Hz the log of a day has about 200 MB."""

SPARE = 1.15
"""The nominal wire must be able to heat and cool faster than the path, by this factor."""


@dataclass(frozen=True)
class ExcitationRecord:
    """The measurements of an excitation: five columns of one length.

    Current and voltage of a sample belong to the period before the sample.
    """

    time_s: NDArray[np.float64]
    current_a: NDArray[np.float64]
    voltage_v: NDArray[np.float64]
    temperature_c: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]


@dataclass(frozen=True)
class Excitation:
    """The temperature path of an identification experiment, with the name of its plan.

    The path leads in straight lines through `turning_points_c` at the rate `rate_c_per_s`. Where the wire cools more
    slowly, the controller holds the path until the wire follows.
    """

    turning_points_c: tuple[float, ...]
    rate_c_per_s: float
    plan: str = "nested"

    def __post_init__(self) -> None:
        """Raise ConfigError for a rate that is not positive, and for a path that lasts longer than `LONGEST_S`."""
        if not self.rate_c_per_s > 0:
            raise ConfigError("must be positive", where="excitation.rate_c_per_s", value=self.rate_c_per_s)
        travel_k = path_length_k(self.turning_points_c)
        if travel_k > LONGEST_S * self.rate_c_per_s:
            raise ConfigError(
                f"lasts too long: {travel_k:.0f} K at rate_c_per_s = {self.rate_c_per_s:g}",
                where="excitation",
                value=f"{travel_k / self.rate_c_per_s:.2g} s",
                limit=f"{LONGEST_S:g} s",
                cure="raise rate_c_per_s to a few kelvins per second. Is its unit K/s?",
            )

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """The times of the turning points, s."""
        legs = np.abs(np.diff(np.asarray(self.turning_points_c))) / self.rate_c_per_s
        return np.concatenate(([0.0], np.cumsum(legs)))

    @property
    def duration_s(self) -> float:
        """Duration of the path, s, without the time for which the controller holds the path."""
        return float(self.times_s[-1])

    @property
    def reversal_curves(self) -> int:
        """The number of curves that begin inside the major loop."""
        inner = self.turning_points_c[1:]
        return sum(min(inner) < point_c < max(inner) for point_c in inner)

    def temperature_c(self, time_s: float) -> float:
        """Return the temperature setpoint at `time_s` after the start, °C. After the path it stays constant."""
        return self._path_c.at(time_s)

    @cached_property
    def _path_c(self) -> PiecewiseLinear:
        return PiecewiseLinear(self.times_s.tolist(), self.turning_points_c)


def path_length_k(turning_points_c: Iterable[float]) -> float:
    """Return the length of the path through `turning_points_c`, K."""
    return sum(abs(after - before) for before, after in pairwise(turning_points_c))


def check_may_excite(excitation: Excitation, balance: HeatBalance, current_max_a: float, found: Measurement) -> None:
    """Raise ConfigError when the nominal wire cannot follow the excitation, or when a measurement is missing or wrong.

    `balance` is the nominal heat balance, `found` a measurement before the start. The displacement must be measured,
    and the wire must not read much colder than its surroundings. `current_max_a` must suffice to heat at the rate of
    the path up to the highest temperature. The wire must cool at this rate at the lowest temperature, where it cools
    slowest. Heating and cooling must have a reserve of the factor `SPARE`.
    """
    if not isfinite(found.displacement_mm):
        raise ConfigError(
            "no displacement is measured, and the identification needs it",
            where="excitation",
            cure="connect a sensor, and add its device to the rig file",
        )
    if is_too_cold(found.temperature_c, balance.ambient_c):
        raise ConfigError(
            "the unheated wire reads colder than its surroundings can be",
            where="excitation",
            value=f"{found.temperature_c:.1f} °C",
            limit=f"{COLD_WIRE_K:g} K below ambient_c = {balance.ambient_c:g} °C",
            cure=CHECK_CALIBRATION,
        )
    inner = excitation.turning_points_c[1:]
    low_c, high_c, rate = min(inner), max(inner), excitation.rate_c_per_s
    needed_w = SPARE * balance.power_w(high_c, rate, 0.0)
    needed_a = balance.current_a(needed_w, 1.0)
    if needed_a > current_max_a:
        raise ConfigError(
            f"{high_c:g} °C at {rate:g} K/s need more current than current_max_a allows",
            where="excitation",
            value=f"about {needed_a:.2f} A",
            limit=f"{current_max_a:g} A",
            cure="lower high_c or rate_c_per_s, or raise current_max_a if the data sheet of the wire allows it",
        )
    cools_c_per_s = (low_c - balance.ambient_c) / balance.time_constant_s / SPARE
    if cools_c_per_s < rate:
        reached_c = balance.ambient_c + SPARE * rate * balance.time_constant_s
        raise ConfigError(
            f"at low_c = {low_c:g} °C the path falls faster than the wire cools",
            where="excitation",
            value=f"{rate:g} K/s",
            limit=f"{cools_c_per_s:.2g} K/s",
            cure=f"raise low_c to {reached_c:.0f}, or lower rate_c_per_s",
        )
