"""The line settings of a scan: those of the profiles, where the options of the URL replace theirs."""

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.scan import _lines, _uses
from smadrive.modbus.transports.transport import SerialSettings

PROFILES = [load_profile(name) for name in ("adam-6018", "autonics-tk", "delta-dtb", "sma-reference")]


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        ("", ["115200 8N1", "9600 8N1", "9600 8N2"]),
        ("?latency_ms=5", ["115200 8N1", "9600 8N1", "9600 8N2"]),
        ("?parity=E", ["115200 8E1", "9600 8E1", "9600 8E2"]),
        ("?stopbits=1&parity=O", ["115200 8O1", "9600 8O1"]),
    ],
)
def test_options_of_the_url_replace_those_of_the_profiles(options, lines):
    assert [*map(str, _lines(f"serial:///dev/ttyUSB0{options}", PROFILES))] == lines


@pytest.mark.parametrize("url", ["serial:///dev/ttyUSB0?parity=E&baudrate=9600", "tcp://host", "rtu+tcp://host:4001"])
def test_settings_of_the_url_are_the_only_ones(url):
    assert _lines(url, PROFILES) == [None]


def test_settings_are_those_with_which_the_port_is_opened():
    (line,) = _lines("serial:///dev/ttyUSB0?stopbits=2", PROFILES[-1:])
    assert line == SerialSettings(115200, "N", 2)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.profile.id)
@pytest.mark.parametrize("options", ["", "?parity=E"])
def test_first_profiles_of_a_line_are_those_with_its_settings(profile, options):
    url = f"serial:///dev/ttyUSB0{options}"
    lines = [line for line in _lines(url, PROFILES) if _uses(profile, url, line)]
    assert lines == [line for line in _lines(url, [profile]) if line is not None]
