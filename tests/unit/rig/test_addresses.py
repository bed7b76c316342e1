"""The addresses in the text of a wrong rig file name the lines that a driver of the right one locks."""

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import lines_of
from smadrive.rig.switching_off.addresses import keys_in


@pytest.mark.parametrize("url", ["serial:///dev/ttyS0", "tcp://10.0.0.5:502", "rtu+tcp://10.0.0.5:502"])
@pytest.mark.parametrize("unit_id", [1, 3])
def test_lines_are_those_of_the_driver(url, unit_id):
    found = {line for key in keys_in(f'url = "{url}"\nunit_id = {unit_id}\nprofile = ') for line in lines_of(key)}
    assert found.issuperset(lines_of(key_at(url, load_profile("riden-rd60xx"), unit_id)))
