"""The check of the thermocouple by the resistance: without a displacement sensor, or if the resistance is the source.

A thermocouple that reads too cold for the heat input is right if a draft cools the wire, and wrong if its bead has come
off. The resistance decides, because it does not depend on the thermocouple. With the current I, the voltage V, and
weights that decay with the age of a sample, the mean resistance and its standard deviation are

    R = Σ V I / Σ I²        σ = σ_U / sqrt(Σ I²)        σ_U the noise of the measurement as a voltage

A wire at T_max or above it is transformed: its resistance is at most the largest R(T, ξ) with T ≥ T_max, and ξ from the
heating branch at T - δ to 1. A wire with a larger resistance is colder than T_max. δ allows for a changed load.

At a reading T of the thermocouple, the resistance lies between the least and the largest R(T ± δ, ξ), with ξ in the
displacement band (displacement_band.py). Otherwise the reading does not belong to the wire.

The measured resistance may be wrong by `MARGIN` and 3 σ. A current below the least current of a measurement is at most
`HELD_SHARE` of the current that holds a wire at T_max, so it cannot heat the wire to T_max. A wire that was colder than
T_max then stays colder, and no reading is compared with the resistance of an earlier time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from math import exp, inf, isfinite, sqrt

import numpy as np

from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.numerics.piecewise_linear import PiecewiseLinear
from smadrive.safety.displacement_band import UNSURE_C, DisplacementBand
from smadrive.safety.resistance_band import current_min_a
from smadrive.safety.temperature_band import UNBOUNDED, AtLeast
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_model import WireModel

MEAN_S = 0.2
"""Time constant with which the weight of a sample decays, s, and the age at which the mean is too old for a reading."""

MARGIN = 0.01
"""Largest error of the resistance apart from its noise, for example by the leads, as a share."""

HELD_SHARE = 0.5
"""A resistance is measured from this share of the current that holds the cold wire at `temperature_max_c`, or less."""

BEYOND_C, POINTS = 300.0, 200
"""Resistances are looked up at this number of temperatures, up to T_max + `BEYOND_C`."""


def always() -> bool:
    """Return True: the sensor is trusted in the whole run."""
    return True


def by_sensor() -> DisplacementFrom:
    """Return SENSOR: the displacement sensor is the source in the whole run."""
    return DisplacementFrom.SENSOR


class TemperatureByResistance:
    """Judges the temperature of `wire` by its `resistance`, as described at the head of this file.

    `source` returns the source of the displacement. While it is NONE, the resistance is not trusted, and nothing is
    judged. While it is RESISTANCE, a reading is judged even if a sensor shows the displacement.
    """

    def __init__(
        self,
        wire: WireModel,
        resistance: WireResistance,
        displacement_band: DisplacementBand,
        temperature_max_c: float,
        current_max_a: float,
        source: Callable[[], DisplacementFrom],
    ) -> None:
        self._wire, self._resistance, self._band, self._source = wire, resistance, displacement_band, source
        held_a = wire.balance.current_a(wire.balance.power_w(temperature_max_c, 0.0, 0.0), 0.0)
        self._least_a = min(current_min_a(current_max_a), HELD_SHARE * held_a)
        hot_c = np.linspace(temperature_max_c, temperature_max_c + BEYOND_C, POINTS).tolist()
        most_ohm = [max(self._ohms(one_c, self._transformed_mm(one_c))) for one_c in hot_c]
        self._hot_ohm = PiecewiseLinear(hot_c, np.maximum.accumulate(most_ohm))
        self._warming_c = np.linspace(wire.model.input_range[0], temperature_max_c, POINTS).tolist()
        least_ohm = [min(self._ohms(one_c, displacement_band.band_mm(one_c))) for one_c in self._warming_c]
        self._falling_ohm = np.minimum.accumulate(least_ohm)[::-1].tolist()
        self._power_w, self._squares_a2, self._time_s, self._now_s = 0.0, 0.0, -inf, 0.0

    def update(self, measurement: Measurement) -> None:
        """Add one measurement. It does not count without a voltage, or with too small a current."""
        self._now_s = measurement.time_s
        current_a, voltage_v = measurement.current_a, measurement.voltage_v
        if not (current_a >= self._least_a and voltage_v > 0.0):
            return
        kept = exp((self._time_s - measurement.time_s) / MEAN_S)
        self._time_s = measurement.time_s
        self._power_w = kept * self._power_w + voltage_v * current_a
        self._squares_a2 = kept * self._squares_a2 + current_a * current_a

    @property
    def is_measured(self) -> bool:
        """True while the mean resistance belongs to the present time."""
        return self._now_s - self._time_s <= MEAN_S

    def excludes_limit(self, hottest_c: float) -> bool:
        """Return True if the wire must be colder than `temperature_max_c`; False before the first measurement.

        `hottest_c` is the greatest possible temperature of the wire by its heat input, °C.
        """
        if not (self._squares_a2 and self._is_trusted):
            return False
        ohm, sure_ohm = self._measured()
        return ohm - sure_ohm > self._hot_ohm.at(hottest_c)

    def at_least(self) -> AtLeast:
        """Return the lowest temperature and phase at which the wire can have this resistance.

        The result is `UNBOUNDED` if a cold wire can have it, and while the resistance is not measured.
        """
        if not (self.is_measured and self._is_trusted):
            return UNBOUNDED
        ohm, sure_ohm = self._measured()
        warmer = POINTS - bisect_right(self._falling_ohm, ohm + sure_ohm)
        if not warmer:
            return UNBOUNDED
        least_c = self._warming_c[min(warmer, POINTS - 1)]
        phase = self._resistance.phase(ohm + sure_ohm, least_c, start=1.0)
        return AtLeast(least_c, min(max(phase, 0.0), 1.0) if isfinite(phase) else 0.0)

    def outside(self, temperature_c: float, displacement_mm: float) -> str | None:
        """Return a text if the resistance does not belong to the reading `temperature_c`, otherwise None.

        The result is None while the resistance is not measured, for a temperature of NaN, and while a sensor is the
        source and shows the displacement (it is not NaN).
        """
        is_judged = not isfinite(displacement_mm) or self._source() is DisplacementFrom.RESISTANCE
        if not (is_judged and self.is_measured and isfinite(temperature_c) and self._is_trusted):
            return None
        ohm, sure_ohm = self._measured()
        ends_mm = self._band.band_mm(temperature_c)
        possible = self._ohms(temperature_c - UNSURE_C, ends_mm) + self._ohms(temperature_c + UNSURE_C, ends_mm)
        low_ohm, high_ohm = min(possible), max(possible)
        if not (ohm + sure_ohm < low_ohm or ohm - sure_ohm > high_ohm):
            return None
        return f"{ohm:.4g} Ω measured, {low_ohm:.4g} to {high_ohm:.4g} Ω possible at {temperature_c:.1f} °C"

    @property
    def _is_trusted(self) -> bool:
        return self._source() is not DisplacementFrom.NONE

    def _measured(self) -> tuple[float, float]:
        """Return the mean resistance and its largest error, Ω."""
        ohm = self._power_w / self._squares_a2
        return ohm, MARGIN * ohm + 3.0 * self._resistance.noise_v / sqrt(self._squares_a2)

    def _transformed_mm(self, temperature_c: float) -> tuple[float, float]:
        """Return the displacements of the heating branch, if a load has moved it by δ, and of its hot end, mm."""
        wire = self._wire
        return self._band.nearest_mm(temperature_c - UNSURE_C, wire.cold_mm), wire.cold_mm + wire.travel_mm

    def _ohms(self, temperature_c: float, displacements_mm: tuple[float, float]) -> list[float]:
        """Return the resistances at this temperature and at these displacements, Ω."""
        phases = [self._wire.phase_at(one_mm) for one_mm in displacements_mm]
        return [self._resistance.ohm(temperature_c, min(max(phase, 0.0), 1.0)) for phase in phases]
