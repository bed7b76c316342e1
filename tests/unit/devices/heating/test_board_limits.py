"""A limit of the rig file that is above the board's own limit."""

import pytest

from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.errors import ExceptionReply


@pytest.mark.parametrize(
    ("limits", "key"), [(HeaterLimits(2.0, 130.0), "current_max_a"), (HeaterLimits(0.6, 180.0), "temperature_max_c")]
)
def test_rejected_limit_names_its_key_in_the_rig_file(device, clock, limits, key):
    board = HeaterBoard(device, clock)
    board.connect()
    with pytest.raises(ExceptionReply) as rejection:
        board.configure(limits, 0.5)
    assert f"limits.{key}" in rejection.value.cure
