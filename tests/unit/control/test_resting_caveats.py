"""A wire at rest: a caveat says that its displacement is not measured, or that the sensor has a wrong zero."""

from math import nan

import pytest

from smadrive.control.references.holding import resting_caveats, resting_mm
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom, Measurement

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
)


def caveats(temperature_c, source, displacement_mm=nan):
    return resting_caveats(MODEL, Measurement(0.0, temperature_c, 0.0, 0.0, displacement_mm), source)


@pytest.mark.parametrize("source", [DisplacementFrom.NONE, DisplacementFrom.SENSOR])
@pytest.mark.parametrize(("temperature_c", "count"), [(22.0, 0), (50.0, 0), (75.0, 1), (130.0, 0)])
def test_caveat_without_a_measurement_where_the_branches_differ(temperature_c, count, source):
    assert len(caveats(temperature_c, source)) == count


def test_caveat_names_the_distance_of_the_branches():
    measured = Measurement(0.0, 75.0, 0.0, 0.0)
    heated = MODEL.step(MODEL.initial_state(140.0), 75.0)
    distance_mm = heated.y - resting_mm(MODEL, measured, DisplacementFrom.NONE)
    assert distance_mm > 5.0
    assert f"{distance_mm:.2g} mm" in caveats(75.0, DisplacementFrom.NONE)[0]


@pytest.mark.parametrize(
    ("source", "displacement_mm"), [(DisplacementFrom.SENSOR, 9.0), (DisplacementFrom.RESISTANCE, nan)]
)
def test_no_caveat_where_sensor_or_resistance_measures(source, displacement_mm):
    assert caveats(75.0, source, displacement_mm) == ()


COLD, HOT = [(22.0, 0.0, 0), (22.0, 0.3, 0), (22.0, 0.7, 1), (22.0, -1.0, 1)], [(130.0, 12.0, 0), (130.0, 11.0, 1)]


@pytest.mark.parametrize(("temperature_c", "displacement_mm", "count"), [*COLD, (75.0, 6.0, 0), *HOT])
def test_sensor_outside_the_loop_has_a_wrong_zero(temperature_c, displacement_mm, count):
    assert len(caveats(temperature_c, DisplacementFrom.SENSOR, displacement_mm)) == count
