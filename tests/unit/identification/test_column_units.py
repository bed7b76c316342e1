"""Columns whose numbers belie the unit of their name."""

import numpy as np
import pytest

from smadrive.identification.column_units import unit_doubts


@pytest.mark.parametrize(
    ("name", "ends", "told"),
    [
        ("temperature_c", (293.0, 393.0), "goes from 293 to 393, which looks like kelvin"),
        ("displacement_mm", (0.001, 0.012), "moves by 0.011 in all, which looks like metres"),
        ("displacement_mm", (0.0, 12_000.0), "looks like micrometres"),
    ],
)
def test_another_unit_is_doubted_with_the_cure(name, ends, told):
    (doubt,) = unit_doubts(name, np.linspace(*ends, 50))
    assert doubt.startswith(name)
    assert told in doubt
    assert "convert it to" in doubt


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
def test_what_a_wire_can_have_and_what_tells_no_unit_is_not_doubted(name, ends):
    assert unit_doubts(name, np.linspace(*ends, 50)) == ()
