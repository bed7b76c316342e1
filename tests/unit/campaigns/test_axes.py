"""The values of an axis, as they stand in the table of results."""

import pytest

from smadrive.campaigns.plan.axes import MOST_WHOLE
from smadrive.campaigns.plan.plan import load_plan
from smadrive.errors import ConfigError

CAMPAIGN = """
title = "x"
[run]
reference = "sine"
[[vary]]
{axis}
[references.sine]
shape = "sine:period_s=56"
"""


@pytest.fixture
def levels(tmp_path):
    """`levels(axis)` are the values of an axis with these keys."""

    def of(axis):
        path = tmp_path / "campaign.toml"
        path.write_text(CAMPAIGN.format(axis=axis), encoding="utf-8")
        return load_plan(str(path)).axes[0].levels

    return of


def test_numbers_and_texts_become_texts(levels):
    assert levels('rig.x = ["a", 1, 2.5]') == ("a", "1", "2.5")


@pytest.mark.parametrize(
    "values", ["[true, 10.0]", "[0, 2, true]", '["1", 1]', '["True", true]'], ids=["float", "int", "text", "bool"]
)
def test_values_that_the_table_cannot_hold_are_an_error(levels, values):
    with pytest.raises(ConfigError) as caught:
        levels(f"rig.x = {values}")
    assert caught.value.where == "[[vary]] 1"
    assert caught.value.value
    assert caught.value.cure


@pytest.mark.parametrize("number", [MOST_WHOLE + 1, -MOST_WHOLE - 2])
def test_whole_number_beyond_64_bits_is_an_error(levels, number):
    with pytest.raises(ConfigError) as caught:
        levels(f"rig.x = [1, {number}]")
    assert (caught.value.where, caught.value.limit) == ("[[vary]] 1", MOST_WHOLE)
    assert levels(f"rig.x = [1, {MOST_WHOLE}]") == (1, MOST_WHOLE)


def test_labels_stand_for_mixed_values(levels):
    assert levels('labels = ["off", "low"]\nrig.x = [false, 0.5]') == ("off", "low")


def test_error_on_a_long_grid_is_short(levels):
    """The values are rounded to six digits, so they are equal."""
    with pytest.raises(ConfigError) as caught:
        levels("rig.x = {low = 1.0, high = 1.0000001, number = 1000}")
    assert len(caught.value.value) < 100
