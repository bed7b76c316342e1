"""The resistance of a data sheet is compared with the alloy, and with the measured resistance."""

from math import nan

import pytest

from smadrive.errors import ConfigError
from smadrive.files.config import validate
from smadrive.wire.data_sheet import RESISTANCE_FACTOR, WireDataSheet, load_data_sheet, resistance_caveats

SHEET = load_data_sheet("flexinol-lt-0.15mm")
NOMINAL_OHM = 16.5


def with_values(**changes):
    return validate(SHEET.model_dump() | changes, WireDataSheet, where="wire.toml")


@pytest.mark.parametrize("changes", [{"resistance_ohm_per_m": 0.055}, {"diameter_mm": 0.015}, {"diameter_mm": 1.5}])
def test_resistivity_that_no_alloy_has_is_an_error_that_names_both_values(changes):
    with pytest.raises(ConfigError) as error:
        with_values(**changes)
    assert "resistance_ohm_per_m = " in str(error.value)
    assert "diameter_mm = " in str(error.value)


@pytest.mark.parametrize("resistance_ohm_per_m", [5.5, 55.0, 200.0])
def test_resistivity_of_other_alloys_is_accepted(resistance_ohm_per_m):
    assert with_values(resistance_ohm_per_m=resistance_ohm_per_m).resistance_ohm_per_m == resistance_ohm_per_m


@pytest.mark.parametrize(
    ("share", "count"), [(1.0, 0), (0.9, 0), (1.4, 0), (0.4, 1), (RESISTANCE_FACTOR * 1.1, 1), (nan, 0)]
)
def test_measured_resistance_far_from_the_data_sheet_is_a_caveat(share, count):
    caveats = resistance_caveats(share * NOMINAL_OHM, SHEET.heat_balance())
    assert len(caveats) == count
    assert all("resistance_ohm_per_m" in text and "16.5 Ω" in text for text in caveats)
