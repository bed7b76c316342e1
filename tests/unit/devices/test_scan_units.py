"""Unit ids on the command line of `scan`."""

import pytest

from smadrive.cli.scan import unit_ids_of
from smadrive.errors import ConfigError


@pytest.mark.parametrize(("text", "units"), [("1-3", [1, 2, 3]), ("1,3,7", [1, 3, 7]), ("0,255", [0, 255])])
def test_unit_ids_are_read(text, units):
    assert unit_ids_of(text) == units


@pytest.mark.parametrize("text", ["", "256", "1-999999999999", "5-1", "1_0", "٣", "-1", "1-2-3", "9" * 5000])
def test_unit_ids_that_no_bus_has_are_refused_at_once(text):
    with pytest.raises(ConfigError):
        unit_ids_of(text)
