"""Columns whose numbers do not fit the unit of their name."""

import numpy as np
import pytest

from smadrive.identification.column_units import unit_doubts


@pytest.mark.parametrize(
    ("name", "ends", "unit"),
    [
        ("temperature_c", (293.0, 393.0), "kelvin"),
        ("displacement_mm", (0.001, 0.012), " metres"),
        ("displacement_mm", (0.0, 12_000.0), "micrometres"),
    ],
)
def test_another_unit_is_doubted_by_its_name(name, ends, unit):
    (doubt,) = unit_doubts(name, np.linspace(*ends, 50))
    assert doubt.startswith(name)
    assert unit in doubt


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
    assert unit_doubts(name, np.linspace(*ends, 50)) == ()
