"""Columns whose numbers do not fit the unit of their name."""

import numpy as np
import pytest

from smadrive.identification.column_units import stroke_caveats, swap_caveats, time_caveats, unit_caveats


@pytest.mark.parametrize(
    ("name", "ends", "unit"),
    [
        ("temperature_c", (293.0, 393.0), "kelvin"),
        ("displacement_mm", (0.001, 0.012), " metres"),
        ("displacement_mm", (0.0, 12_000.0), "micrometres"),
    ],
)
def test_another_unit_is_doubted_by_its_name(name, ends, unit):
    (caveat,) = unit_caveats(name, np.linspace(*ends, 50))
    assert caveat.startswith(name)
    assert unit in caveat


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("temperature_c", (20.0, 120.0)),
        ("wire_c", (-40.0, 340.0)),
        ("displacement_mm", (-0.4, 0.1)),
        ("displacement_mm", (0.0, 400.0)),
        ("temperature_k", (293.0, 393.0)),
        ("strain", (0.0, 0.04)),
        ("displacement_m", (0.0, 0.004)),
    ],
)
def test_usual_values_and_names_without_a_unit_are_not_doubted(name, ends):
    assert unit_caveats(name, np.linspace(*ends, 50)) == ()


@pytest.mark.parametrize(("stroke_mm", "percent"), [(12_000.0, "4000 %"), (0.012, "0.004 %")])
def test_stroke_that_the_wire_cannot_have_is_doubted(stroke_mm, percent):
    (caveat,) = stroke_caveats(np.linspace(0.0, stroke_mm, 50), 300.0)
    assert percent in caveat
    assert "length_mm = 300" in caveat
    assert "check the unit and the scale of the sensor" in caveat


@pytest.mark.parametrize(("stroke_mm", "length_mm"), [(12.0, 300.0), (0.08, 2.0), (2000.0, 50_000.0)])
def test_stroke_that_the_wire_can_have_is_not_doubted(stroke_mm, length_mm):
    assert stroke_caveats(np.linspace(-1.0, stroke_mm - 1.0, 50), length_mm) == ()


LOOP_C = np.concatenate([np.linspace(25.0, 125.0, 500), np.linspace(125.0, 25.0, 500)])


@pytest.mark.parametrize("rate_k_per_s", [0.5, 2.0, 9.0])
def test_time_in_milliseconds_is_doubted(rate_k_per_s):
    times_s = np.linspace(0.0, 200.0 / rate_k_per_s, LOOP_C.size)
    assert time_caveats(times_s, "temperature_c", LOOP_C) == ()
    (caveat,) = time_caveats(1e3 * times_s, "temperature_c", LOOP_C)
    assert "looks like milliseconds: convert it to s" in caveat


def test_slow_oven_and_another_input_are_not_doubted():
    of_an_oven_s = np.linspace(0.0, 200.0 * 60.0, LOOP_C.size)
    assert time_caveats(of_an_oven_s, "temperature_c", LOOP_C) == ()
    assert time_caveats(1e3 * of_an_oven_s, "current_a", LOOP_C) == ()


NAMES = ("temperature_c", "displacement_mm")


@pytest.mark.parametrize(
    ("names", "v", "y", "caveats"),
    [
        (NAMES, (0.0, 12.0), (20.0, 120.0), 1),
        (NAMES, (20.0, 120.0), (0.0, 12.0), 0),
        (NAMES, (20.0, 120.0), (150.0, 162.0), 0),
        (NAMES, (20.0, 35.0), (0.0, 2.0), 0),
        (("strain", "displacement_mm"), (0.0, 12.0), (20.0, 120.0), 0),
    ],
)
def test_exchanged_columns_are_doubted(names, v, y, caveats):
    assert len(swap_caveats(names, np.linspace(*v, 50), np.linspace(*y, 50))) == caveats
