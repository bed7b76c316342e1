"""A sensor that is slower than the loop: one wrong reading is one sample, in however many ticks it is shown."""

from dataclasses import replace
from math import nan

import pytest

from smadrive.measurement import Measurement
from smadrive.safety.faults import Fault
from smadrive.safety.supervisor import Supervisor
from tests.unit.safety import limits

TICKS = 5
"""Number of ticks that show one reading."""

LIMITS = replace(limits.LIMITS, temperature_min_c=10.0, displacement_max_mm=9.0)


def trip_of(temperatures_c, displacements_mm):
    """The fault, and the number of the reading that trips, counted from 1. The two sensors are read together."""
    supervisor = Supervisor(LIMITS)
    for number, (temperature_c, displacement_mm) in enumerate(zip(temperatures_c, displacements_mm, strict=True), 1):
        for tick in range(TICKS):
            age_s, time_s = 0.05 * tick + 0.01, 0.05 * (TICKS * number + tick)
            ages = {"temperature_age_s": age_s, "displacement_age_s": age_s}
            one = Measurement(time_s, temperature_c, 0.2, 3.3, displacement_mm, in_force_a=0.2, armed=True, **ages)
            if trip := supervisor.update(one, nan):
                return number, trip.fault
    return None


def test_a_reading_of_unknown_age_counts_in_every_tick():
    supervisor = Supervisor(LIMITS)
    hot = Measurement(0.0, 140.0, 0.2, 3.3, 5.0, in_force_a=0.2, armed=True, temperature_age_s=nan)
    assert [supervisor.update(hot, nan) is None for _ in range(2)] == [True, False]


@pytest.mark.parametrize(
    ("temperature_c", "displacement_mm", "trips"),
    [
        (140.0, 5.0, (4, Fault.OVER_TEMPERATURE)),
        (5.0, 5.0, (5, Fault.UNDER_TEMPERATURE)),
        (60.0, 9.5, (5, Fault.OVER_DISPLACEMENT)),
    ],
)
def test_one_wrong_reading_does_not_trip_and_several_do(temperature_c, displacement_mm, trips):
    once = [60.0, 60.0, temperature_c, 60.0, 60.0], [5.0, 5.0, displacement_mm, 5.0, 5.0]
    assert trip_of(*once) is None
    several = [60.0, 60.0, *3 * [temperature_c]], [5.0, 5.0, *3 * [displacement_mm]]
    assert trip_of(*several) == trips
