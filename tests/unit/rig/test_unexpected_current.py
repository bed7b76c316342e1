"""A current that flows although none is commanded gives a warning where a display would say that the heater is off."""

from math import nan

import pytest

from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.rig.supervision import unexpected_current

CONFIG = load_rig("in-process")
MOST_A = 0.05
"""The current that counts as noise of the measurement."""


@pytest.mark.parametrize(
    ("current_a", "in_force_a", "is_warned"),
    [
        (0.9 * MOST_A, 0.0, False),
        (1.1 * MOST_A, 0.0, True),
        (-1.1 * MOST_A, 0.0, True),
        (nan, 0.0, False),
        (0.3, 0.3, False),
    ],
)
def test_measured_current_without_a_command_gives_a_warning(current_a, in_force_a, is_warned):
    measurement = Measurement(0.0, 22.0, current_a, 0.0, in_force_a=in_force_a)
    assert (unexpected_current(CONFIG, measurement) is not None) is is_warned
