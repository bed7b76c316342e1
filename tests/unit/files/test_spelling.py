"""An unknown name gets the nearest known one as a suggestion."""

import pytest

from smadrive.files.spelling import suggestion, suggestion_or_list

KNOWN = ("temperature", "displacement")


def test_nearest_name_is_suggested():
    assert suggestion("temprature", KNOWN) == suggestion_or_list("temprature", KNOWN) == "did you mean 'temperature'?"


@pytest.mark.parametrize("name", ["", "x", "pressure"])
def test_without_a_near_name_all_are_listed(name):
    assert suggestion(name, KNOWN) == ""
    assert suggestion_or_list(name, KNOWN) == "known are: displacement, temperature"
