"""The pauses between frames."""

import pytest

from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.framing import rtu

READ = requests.read_holding(10, 4)
RIGHT = rtu.seal(1, bytes.fromhex("03 08 000A 000B 000C 000D"))


@pytest.mark.parametrize(
    ("baudrate", "pause_s"), [(9600, 3.5 * 11 / 9600), (19200, 3.5 * 11 / 19200), (115200, 1.75e-3)]
)
def test_the_pause_between_frames_is_that_of_the_standard(bus, script, baudrate, pause_s):
    far = script([(0.0, RIGHT)], [(0.0, RIGHT)], [(0.0, RIGHT)])
    client = bus(far, baudrate)
    for timing in (BusTiming(), BusTiming(), BusTiming(silence=False)):
        client.execute(1, READ, timing)
    times_s = [time_s for time_s, _ in far.heard]
    assert times_s[1] - times_s[0] == pytest.approx(pause_s)
    assert times_s[2] == times_s[1]


def test_profile_may_require_a_longer_pause(bus, script):
    far = script([(0.0, RIGHT)], [(0.0, RIGHT)])
    client = bus(far)
    for _ in range(2):
        client.execute(1, READ, BusTiming(min_gap_s=0.05))
    assert far.heard[1][0] - far.heard[0][0] == pytest.approx(0.05)
