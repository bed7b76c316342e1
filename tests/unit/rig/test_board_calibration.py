"""The gains of a board from what multimeters showed."""

import pytest

from smadrive.errors import ConfigError
from smadrive.rig.ports.board_calibration import HeldCurrent, new_gains

ONE = dict.fromkeys(("current_gain", "voltage_gain", "source_gain"), 1.0)
CONSTANTS = ONE | dict.fromkeys(("current_offset", "voltage_offset", "source_offset"), 0.0)


def test_gains_make_the_board_agree_with_the_multimeters():
    gains = new_gains(CONSTANTS, HeldCurrent(set_a=0.3, shown_a=0.33, true_a=0.297, shown_v=5.0, true_v=4.9))
    assert gains == pytest.approx({"source_gain": 0.3 / 0.297, "current_gain": 0.9, "voltage_gain": 0.98})


def test_second_calibration_starts_from_the_first():
    constants = CONSTANTS | {"current_gain": 0.9, "current_offset": 0.01, "source_gain": 1.1}
    gains = new_gains(constants, HeldCurrent(set_a=0.3, shown_a=0.31, true_a=0.3, shown_v=5.0, true_v=5.0))
    assert gains["current_gain"] == pytest.approx(0.9 * 0.29 / 0.30)
    assert gains["source_gain"] == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("held", "where"),
    [
        (HeldCurrent(0.3, 0.3, 0.2, 5.0, 5.0), "--current"),
        (HeldCurrent(0.3, 0.2, 0.3, 5.0, 5.0), "--current"),
        (HeldCurrent(0.3, 0.3, 0.3, 5.0, 9.0), "--voltage"),
        (HeldCurrent(0.3, 0.0, 0.3, 5.0, 5.0), ""),
        (HeldCurrent(0.3, 0.3, 0.3, 0.1, 0.1), ""),
    ],
)
def test_readings_that_cannot_be_right_are_an_error(held, where):
    with pytest.raises(ConfigError) as error:
        new_gains(CONSTANTS, held)
    assert error.value.where == where
