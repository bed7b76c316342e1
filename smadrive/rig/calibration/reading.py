"""The reading of a sensor at a known value: the mean of several seconds with the heater off."""

from __future__ import annotations

from math import hypot, isfinite, sqrt
from statistics import fmean, stdev
from typing import NamedTuple

from smadrive.errors import ConfigError, DataError
from smadrive.rig.rig import Rig

LEAST_READINGS = 4


class CalibratedQuantity(NamedTuple):
    """A quantity whose sensor can be calibrated. Its numbers have the unit `unit`.

    suffix               suffix of its keys in the rig file
    value_field          the field of a Measurement with its reading
    age_field            the field of a Measurement with the age of the reading, s
    steady               largest change of the mean between the two halves of the readings at a known value
    known_values         allowed range of the known values
    value_uncertainty    default standard uncertainty of a known value: of a stirred bath, of a gauge
    """

    unit: str
    suffix: str
    value_field: str
    age_field: str
    steady: float
    known_values: tuple[float, float]
    value_uncertainty: float


QUANTITIES = {
    "temperature": CalibratedQuantity(
        unit="°C",
        suffix="c",
        value_field="temperature_c",
        age_field="temperature_age_s",
        steady=0.5,
        known_values=(-100.0, 600.0),
        value_uncertainty=0.1,
    ),
    "displacement": CalibratedQuantity(
        unit="mm",
        suffix="mm",
        value_field="displacement_mm",
        age_field="displacement_age_s",
        steady=0.02,
        known_values=(-1e4, 1e4),
        value_uncertainty=0.01,
    ),
}
"""The quantities by name. A sensor has the name of its quantity."""


class SteadyReading(NamedTuple):
    """The mean of `samples` readings, and the standard uncertainty of the mean, in °C or mm.

    The uncertainty combines the scatter of the readings and the change between their two halves. The change counts as
    the half-width of a uniform distribution.
    """

    mean: float
    uncertainty: float
    samples: int


def read_steadily(rig: Rig, quantity: str, duration_s: float) -> SteadyReading:
    """Return the mean of the readings of `quantity` over `duration_s`; the heater stays off.

    DataError when a reading is invalid, the readings are not steady, or there are fewer than `LEAST_READINGS`.
    """
    by_time: dict[float, float] = {}
    end_s = rig.clock.now_s() + duration_s
    while rig.clock.now_s() < end_s:
        by_time.update([_valid(rig, quantity)])
        rig.clock.sleep_until(rig.clock.now_s() + rig.period_s)
    readings = list(by_time.values())
    if len(readings) < LEAST_READINGS:
        raise DataError("too few readings", value=len(readings), limit=LEAST_READINGS, cure="read for a longer time")
    half, unit, limit = len(readings) // 2, QUANTITIES[quantity].unit, QUANTITIES[quantity].steady
    change = fmean(readings[half:]) - fmean(readings[:half])
    if abs(change) > limit:
        raise DataError(
            f"the {quantity} is not steady",
            value=f"changes by {change:+.3g} {unit} within {duration_s:g} s",
            limit=f"{limit:g} {unit}",
            cure="wait until the sensor stands still at the known value, then calibrate again",
        )
    scatter = stdev(readings) / sqrt(len(readings))
    return SteadyReading(fmean(readings), hypot(scatter, abs(change) / sqrt(3)), len(readings))


def check_measured(rig: Rig, quantity: str) -> None:
    """Raise ConfigError if no device of the rig measures `quantity`. The rig need not be open."""
    if not rig.measures(quantity):
        raise ConfigError(
            f"no device of the rig measures the {quantity}",
            where=f"rig '{rig.config.name}'",
            cure="add the sensor to [[devices]] in the rig file, or calibrate the other sensor",
        )


def check_reading(rig: Rig, quantity: str) -> None:
    """Raise DataError if the sensor of `quantity` gives no valid reading now. The rig must be open."""
    _valid(rig, quantity)


def _valid(rig: Rig, quantity: str) -> tuple[float, float]:
    """Return the time and the value of the sensor's latest reading; DataError when it is invalid.

    The time is the time of the measurement minus the age of the reading, rounded to microseconds. So two measurements
    that return the same reading give the same time.
    """
    measurement, fields = rig.measure(), QUANTITIES[quantity]
    value, age_s = getattr(measurement, fields.value_field), getattr(measurement, fields.age_field)
    if not isfinite(value):
        raise DataError(
            f"no valid {quantity}",
            where=f"rig '{rig.config.name}'",
            value=measurement.temperature_fault if quantity == "temperature" else None,
            cure="connect the sensor, and check it with `smadrive probe RIG`",
        )
    return round(measurement.time_s - age_s, 6), value
